"""Explain in words why an estimate is `degraded`."""

from collections.abc import Mapping, Sequence

from contactsense.residuals.sensor_consistency import SensorConsistency, describe_inconsistency
from contactsense.sensors.stream_state import (
    BLIND,
    INCONSISTENT,
    INVALID,
    LONGEST_STEP,
    MISSING,
    RESTARTED,
    SETTLING,
    UNSETTLED,
)
from contactsense.sensors.timing import LONGEST_FIRST_STEP

NEW_STREAM = "a new stream begins, in which the observer is settling"
"""Part of the reason of the first estimate after the samples were those of another clock."""
SET_BACK = f"t: expected a later time than that of the previous sample, got an earlier one: {NEW_STREAM}"
"""Why a stream begins anew within the samples of one clock."""


def degraded_reason(
    sensors: Sequence[str],
    flags: int,
    consistency: SensorConsistency,
    refused: Mapping[str, str],
    step: float,
    restart: str,
) -> str:
    """Why a sample's estimate is `degraded`, in words.

    Args:
        sensors: Names of the sensors, in the order of their flags.
        flags: Of the sample, see `contactsense.sensors.stream_state`.
        consistency: Of the stream.
        refused: Sensor -> why its value was taken out of the sample.
        step: Time since the previous sample [s].
        restart: Why the stream begins with this sample, empty if it does not or if that is no news.
    """
    reasons = [restart] if restart else []
    for i, name in enumerate(sensors):
        if flags & ((MISSING | INVALID) << i | BLIND) and name in refused:
            reasons.append(refused[name])
        elif flags & MISSING << i:
            reasons.append(f"{name} is missing")
        elif flags & INVALID << i:
            reasons.append(f"{name} is not finite or implausibly large")
        elif flags & UNSETTLED << i and not flags & SETTLING:
            reasons.append(f"{name} is settling after its start: not used yet")
    if flags & INCONSISTENT:
        reasons += describe_inconsistency(consistency)
    if flags & RESTARTED:
        reasons.append(SET_BACK)
    if flags & SETTLING and step > LONGEST_FIRST_STEP:
        got = f"{step:.4g} s" if step < LONGEST_STEP else "a day or more"
        reasons.append(
            f"t: expected at most {LONGEST_FIRST_STEP:g} s from one sample to the next, got {got}; is "
            "the time in milliseconds?"
        )
    if flags & BLIND and not reasons:
        reasons.append("no sensor has a value in this sample")
    if flags & SETTLING and not reasons:
        reasons.append("the observer is settling after its start")
    return "; ".join(reasons)
