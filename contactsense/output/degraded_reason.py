"""Explain in words why an estimate is `degraded`."""

from contactsense.residuals.sensor_consistency import SensorConsistency, describe_inconsistency
from contactsense.sensors.sample_fields import SENSORS
from contactsense.sensors.stream_state import INCONSISTENT, INVALID, MISSING, SETTLING


def degraded_reason(flags: int, consistency: SensorConsistency) -> str:
    """Why a sample's estimate is `degraded`, in words.

    Args:
        flags: Of the sample, see `contactsense.sensors.stream_state`.
        consistency: Of the stream.
    """
    reasons = []
    for i, name in enumerate(SENSORS):
        if flags & MISSING << i:
            reasons.append(f"{name} is missing")
        elif flags & INVALID << i:
            reasons.append(f"{name} is not finite or implausibly large")
    if flags & INCONSISTENT:
        reasons += describe_inconsistency(consistency)
    if flags & SETTLING and not reasons:
        reasons.append("the observer is settling after its start")
    return "; ".join(reasons)
