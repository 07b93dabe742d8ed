"""What readings say of a force/torque sensor by themselves: its range, and the wrist sensor's bias."""

from dataclasses import replace

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.scene import Scene, WrenchSensor
from contactsense.setup_check.fit import Fit
from contactsense.setup_check.hypotheses import Line
from contactsense.setup_check.motion_basis import Readings
from contactsense.setup_check.proposals import written
from contactsense.setup_check.result import Finding, Residuals, Verdict
from contactsense.setup_check.setup import Place, Setup

_ROUNDING = 1e-6
"""A reading at its limit is beyond it in spite of being converted to base axes and back."""
_BIAS_TOLERANCE = 2.0
"""A wrist sensor's bias may be off by this multiple of its noise: more may appear as a contact."""
_SURE = 5.0
"""And it must be off by this many standard deviations of the estimate."""
_FIELDS: tuple[tuple[Place, str], ...] = (("base", "reading"), ("wrist", "wrist"))
"""Each sensor, and its readings in a recording."""


def rms(values: np.ndarray) -> float | None:
    """Root mean square; None where a value is missing."""
    return float(np.sqrt(np.mean(values**2))) if np.isfinite(values).all() else None


def residuals_of(r: np.ndarray) -> Residuals:
    """Root mean squares of residuals, shape (M, n + 12), see `contactsense.setup_check.fit.Fit`."""
    n = r.shape[1] - 12
    force, moment, wrist_force, wrist_moment = (rms(r[:, n + i : n + i + 3]) for i in (0, 3, 6, 9))
    return Residuals(force, moment, rms(r[:, :n]), wrist_force, wrist_moment)


def saturated_sensors(scene: Scene, recordings: list[FreeMotion]) -> tuple[Place, ...]:
    """Sensors of which a component stays at its range: their readings are not what they carry."""
    found = []
    for place, field in _FIELDS:
        sensor: WrenchSensor | None = getattr(scene, f"{place}_wrench")
        readings = _readings(recordings, field)
        if sensor is not None and readings is not None:
            at = np.abs(np.abs(readings) / sensor.limits - 1.0) < _ROUNDING
            if (at.sum(axis=0) > 1).any():
                found.append(place)
    return tuple(found)


def without(part: FreeMotion, places: tuple[Place, ...]) -> FreeMotion:
    """The recording without the readings of some sensors."""
    return replace(
        part,
        reading=None if "base" in places else part.reading,
        wrist=None if "wrist" in places else part.wrist,
    )


def range_findings(
    scene: Scene, recordings: list[FreeMotion], setup: Setup, saturated: tuple[Place, ...]
) -> list[Finding]:
    """Whether the readings stay within the ranges that the scene states.

    Args:
        scene: What is checked.
        recordings: Without the readings of saturated sensors.
        setup: What explains the readings: in which order their values come.
        saturated: Sensors at their range.
    """
    found = []
    for place, field in _FIELDS:
        sensor: WrenchSensor | None = getattr(scene, f"{place}_wrench")
        readings = _readings(recordings, field)
        if sensor is None or sensor.range is None:
            continue
        line: Line = "base_wrench.range" if place == "base" else "wrist_wrench.range"
        stated = _numbers(sensor.range)
        if place in saturated:
            remark = "the readings stay at it: the sensor cannot measure this arm's weight and motion"
            found.append(Finding(line, "does_not_fit", stated, "a sensor of larger range", remark))
        elif readings is None:
            found.append(Finding(line, "cannot_tell", stated, remark="not recorded"))
        else:
            largest = np.abs(readings @ setup.sensor(place).order).max(axis=0)
            if (largest >= sensor.limits).any():
                most = (largest[:3].max(), largest[3:].max()) if len(sensor.range) == 2 else tuple(largest)
                remark = "readings without a contact are larger"
                found.append(Finding(line, "does_not_fit", stated, f"more than {_numbers(most)}", remark))
            else:
                found.append(Finding(line, "fits", stated))
    return found


def _readings(recordings: list[FreeMotion], field: str) -> np.ndarray | None:
    parts = [getattr(part, field) for part in recordings if getattr(part, field) is not None]
    return np.concatenate(parts) if parts else None


def _numbers(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"


def wrist_bias_finding(scene: Scene, readings: Readings, fit: Fit) -> list[Finding]:
    """Whether the wrist sensor has the bias that the scene states: unlike that of the base sensor, a stream
    does not estimate it.

    Args:
        scene: What is checked.
        readings: Which sensors were recorded.
        fit: The setup that explains the readings.
    """
    if scene.wrist_wrench is None or readings.wrist is None:
        return []
    sensor, setup = scene.wrist_wrench, fit.setup
    allowed = _BIAS_TOLERANCE * np.repeat([sensor.force_noise, sensor.moment_noise], 3)
    off, std = fit.wrist_bias, fit.wrist_bias_std
    stated = written("wrist_wrench.bias", setup, scene)[0]
    if (setup.wrist.order != np.eye(6)).any():
        # Whether the stated bias is in the order as read is not known.
        return [Finding("wrist_wrench.bias", "cannot_tell", stated, remark="its values are in another order")]
    spread = tuple(std.tolist())
    if (np.abs(off) > np.maximum(allowed, _SURE * std)).any():
        right = setup.with_sensor("wrist", bias=setup.wrist.bias + off)
        before = fit.residual.copy()
        before[:, -6:] += off
        return [
            Finding(
                "wrist_wrench.bias",
                "does_not_fit",
                stated,
                written("wrist_wrench.bias", right, scene)[0],
                "",
                spread,
                residuals_of(before),
                residuals_of(fit.residual),
            )
        ]
    verdict: Verdict = "cannot_tell" if (std > allowed).any() else "fits"
    remark = "not determined by this motion" if verdict == "cannot_tell" else ""
    return [Finding("wrist_wrench.bias", verdict, stated, remark=remark, std=spread)]
