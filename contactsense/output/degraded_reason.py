"""Explain in words why an estimate is `degraded`."""

from collections.abc import Mapping

from contactsense.residuals.sensor_consistency import SensorConsistency, describe_inconsistency
from contactsense.sensors.sample_fields import SENSORS
from contactsense.sensors.stream_state import BLIND, INCONSISTENT, INVALID, MISSING, SETTLING
from contactsense.sensors.timing import LONGEST_GAP


def degraded_reason(
    flags: int, consistency: SensorConsistency, refused: Mapping[str, str], step: float
) -> str:
    """Why a sample's estimate is `degraded`, in words.

    Args:
        flags: Of the sample, see `contactsense.sensors.stream_state`.
        consistency: Of the stream.
        refused: Sensor -> why its value was taken out of the sample.
        step: Time since the previous sample [s].
    """
    reasons = []
    for i, name in enumerate(SENSORS):
        if flags & ((MISSING | INVALID) << i | BLIND) and name in refused:
            reasons.append(refused[name])
        elif flags & MISSING << i:
            reasons.append(f"{name} is missing")
        elif flags & INVALID << i:
            reasons.append(f"{name} is not finite or implausibly large")
    if flags & INCONSISTENT:
        reasons += describe_inconsistency(consistency)
    if flags & SETTLING and step > LONGEST_GAP:
        reasons.append(
            f"t: expected at most {LONGEST_GAP:g} s from one sample to the next, got {step:.4g} s; is the "
            "time in milliseconds?"
        )
    if flags & BLIND and not reasons:
        reasons.append("no sensor has a value in this sample")
    if flags & SETTLING and not reasons:
        reasons.append("the observer is settling after its start")
    return "; ".join(reasons)
