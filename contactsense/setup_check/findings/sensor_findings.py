"""What readings say of a force/torque sensor by themselves: its range, and the bias of one within the arm."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.scene import Scene, WrenchSensor
from contactsense.scene_model.reading_limits import ROUNDING
from contactsense.setup_check.findings.proposals import line_value
from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.result import Finding, Residuals, Verdict, WrenchResidual
from contactsense.setup_check.setup import BASE, Setup

_BIAS_TOLERANCE = 2.0
"""The bias of a sensor may be off by this multiple of its noise: more may appear as a contact."""
_SURE = 5.0
"""And it must be off by this many standard deviations of the estimate."""


def rms(values: np.ndarray) -> float | None:
    """Root mean square of the values that are there; None where there is none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else None


def residuals_of(fit: Fit, fields: Sequence[str]) -> Residuals:
    """Root mean squares of the residuals of a fit, in the units that its setup takes the values for.

    Args:
        fit: What remains, with the setup.
        fields: The force/torque sensors in the order of their channels.
    """
    r = fit.residual / fit.setup.per_unit(fields)
    n = r.shape[1] - 6 * len(fields)
    parts = {}
    for i, field in enumerate(fields):
        force, moment = (rms(r[:, first : first + 3]) for first in (n + 6 * i, n + 6 * i + 3))
        if force is not None and moment is not None:
            parts[field] = WrenchResidual(force, moment)
    base = parts.pop(BASE, None)
    return Residuals(
        None if base is None else base.force, None if base is None else base.moment, rms(r[:, :n]), parts
    )


def saturated_sensors(scene: Scene, recordings: list[FreeMotion]) -> tuple[str, ...]:
    """Fields of the sensors of which a component stays at its range: their readings are not what they
    carry."""
    found = []
    for field, sensor in _sensors(scene).items():
        readings = _readings(recordings, field)
        if readings is not None:
            at = np.abs(np.abs(readings) / sensor.limits - 1.0) < ROUNDING
            if (at.sum(axis=0) > 1).any():
                found.append(field)
    return tuple(found)


def without(part: FreeMotion, fields: Collection[str]) -> FreeMotion:
    """The recording without the readings of some sensors, by their fields of the scene."""
    kept = part.with_readings({name: x for name, x in part.readings.items() if name not in fields})
    return replace(kept, torque=None) if "joint_torque" in fields else kept


def range_findings(
    scene: Scene, recordings: list[FreeMotion], setup: Setup, saturated: tuple[str, ...]
) -> list[Finding]:
    """Whether the readings stay within the ranges that the scene states.

    Args:
        scene: What is checked.
        recordings: Without the readings of saturated sensors.
        setup: What explains the readings: in which order their values come.
        saturated: Fields of the sensors at their range.
    """
    found = []
    for field, sensor in _sensors(scene).items():
        readings = _readings(recordings, field)
        if sensor.range is None:
            continue
        line, stated = f"{field}.range", _numbers(sensor.range)
        if field in saturated:
            remark = "the readings stay at it: the sensor cannot measure this arm's weight and motion"
            found.append(Finding(line, "does_not_fit", stated, "a sensor of larger range", remark))
        elif readings is None:
            found.append(Finding(line, "cannot_tell", stated, remark="not recorded"))
        else:
            largest = np.abs(readings @ np.linalg.inv(setup.sensors[field].order).T).max(axis=0)
            if (largest >= sensor.limits).any():
                most = (largest[:3].max(), largest[3:].max()) if len(sensor.range) == 2 else tuple(largest)
                remark = "readings without a contact are larger"
                found.append(Finding(line, "does_not_fit", stated, f"more than {_numbers(most)}", remark))
            else:
                found.append(Finding(line, "fits", stated))
    return found


def _sensors(scene: Scene) -> dict[str, WrenchSensor]:
    """All force/torque sensors of a scene by field."""
    base = {} if scene.base_wrench is None else {BASE: scene.base_wrench}
    return base | scene.link_sensors


def _readings(recordings: list[FreeMotion], field: str) -> np.ndarray | None:
    parts = [part.readings[field] for part in recordings if field in part.readings]
    return np.concatenate(parts) if parts else None


def _numbers(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"


def bias_findings(scene: Scene, fit: Fit) -> list[Finding]:
    """Whether the measured sensors within the arm have the biases that the scene states: unlike that of the
    base sensor, a stream does not estimate them.

    Args:
        scene: What is checked.
        fit: The setup that explains the readings.
    """
    return [
        _bias_finding(scene, fit, field, sensor)
        for field, sensor in scene.link_sensors.items()
        if field in fit.bias
    ]


def base_offset(scene: Scene, fitter: Fitter, setup: Setup) -> tuple[float, ...] | None:
    """What the base sensor reads beyond weight and bias, shape (6,) [N, Nm], where it is worth telling: see
    `SetupCheck.base_offset`. A stream estimates the drift of the bias, but takes an offset that is there from
    its start for a contact.

    Args:
        scene: What is checked.
        fitter: Of the recordings, in which the base sensor may be missing.
        setup: The one that explains the readings.
    """
    sensor = scene.base_wrench
    if sensor is None or (setup.sensors[BASE].order != np.eye(6)).any():
        return None
    off = fitter.offset(setup, BASE)
    allowed = _BIAS_TOLERANCE * np.repeat([sensor.force_noise, sensor.moment_noise], 3)
    return tuple(off.tolist()) if (np.abs(off) > allowed).any() else None


def _bias_finding(scene: Scene, fit: Fit, field: str, sensor: WrenchSensor) -> Finding:
    line, setup, fields = f"{field}.bias", fit.setup, tuple(fit.setup.sensors)
    allowed = _BIAS_TOLERANCE * np.repeat([sensor.force_noise, sensor.moment_noise], 3)
    off, std = fit.bias[field]
    stated, spread = line_value(line, setup, scene)[0], tuple(std.tolist())
    if (setup.sensors[field].order != np.eye(6)).any():
        # Whether the stated bias is in the order and units as read is not known.
        return Finding(line, "cannot_tell", stated, remark="its values are in another order or unit")
    if (np.abs(off) > np.maximum(allowed, _SURE * std)).any():
        right = setup.with_sensor(field, bias=setup.sensors[field].bias + off)
        before = fit.residual.copy()
        first = before.shape[1] - 6 * (len(fields) - fields.index(field))
        before[:, first : first + 6] += off
        return Finding(
            line,
            "does_not_fit",
            stated,
            line_value(line, right, scene)[0],
            "",
            spread,
            residuals_of(replace(fit, residual=before), fields),
            residuals_of(fit, fields),
        )
    verdict: Verdict = "cannot_tell" if (std > allowed).any() else "fits"
    remark = "not determined by this motion" if verdict == "cannot_tell" else ""
    return Finding(line, verdict, stated, remark=remark, std=spread)
