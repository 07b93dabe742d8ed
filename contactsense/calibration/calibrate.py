"""Calibration from contact-free motion: estimate the identifiable parameters of arm and sensors.

Gauss-Newton on the residuals of the momentum observer. Each iteration linearizes all equations, determines
which parameters the motion excites, and solves for those. The velocities of the smooth sign functions of
friction enter nonlinearly and are chosen from a grid. Friction coefficients that come out negative and
optional parameters without significance are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.identifiability import excited_directions
from contactsense.calibration.noise_estimation import NoiseLevels, estimate_noise
from contactsense.calibration.parameters import (
    GROUPS,
    NOT_NEGATIVE,
    OPTIONAL,
    Entry,
    Group,
    apply_step,
    entries,
    value,
)
from contactsense.calibration.recording_residuals import friction, residuals
from contactsense.calibration.residual_jacobian import linearize, settled_samples
from contactsense.calibration.result import Calibration, Value, residual_statistics, scene_of
from contactsense.calibration.robust_least_squares import RobustFit, fit_robust
from contactsense.calibration.torque_signal_meaning import compare_meanings, setting_warnings
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.runtime.constants import wrench_transform
from contactsense.scene import Scene

_MIN_ITERATIONS, _MAX_ITERATIONS = 3, 12
_CONVERGED = 0.1
"""Iterations continue until no parameter changes by more than this fraction of its standard deviation. Torque
constants multiply the measurement, so they may need several."""
_ROWS_PER_PERIOD = 10.0
"""Rows kept per second and hertz of bandwidth; more are redundant."""
_MIN_SIGNIFICANCE = 2.5
"""Load-dependent and lubricant friction are used if they differ from zero by this many standard deviations.
"""
_VELOCITIES = (0.002, 0.005, 0.01, 0.02, 0.05)
_LUBRICANT_VELOCITIES = (0.1, 0.2, 0.4)
_CURRENTS = ("actual_current", "actual_current_minus_target")


_NOT_EXCITED = "not excited by this motion: kept"


class CalibrationError(ValueError):
    """The recordings cannot be used for calibration; the message gives the reason and a remedy."""


@dataclass(frozen=True)
class Settings:
    """Which parameters are estimated, and how."""

    groups: tuple[Group, ...]
    """Groups of parameters to estimate."""
    inertia_error: float = 0.1
    """Relative standard deviation of the links' masses about the robot's data."""
    widths: bool = True
    """Whether the velocities of the smooth sign functions of friction are estimated too."""


def default_groups(scene: Scene, recordings: list[FreeMotion]) -> tuple[Group, ...]:
    """Groups that can be estimated with these sensors, except the links' inertia, which must be requested."""
    groups: list[Group] = ["payload"]
    torque = scene.joint_torque
    if torque is not None and any(recording.torque is not None for recording in recordings):
        groups += ["bias"]
        if torque.contains != "external":
            groups += ["coulomb", "viscous", "rotor", "load", "lubricant"]
            groups += ["gain"] if torque.signal in _CURRENTS else []
    if scene.base_wrench is not None and any(recording.reading is not None for recording in recordings):
        groups += ["wrench_bias", "tilt", "turn", "shift", "delay"]
    return tuple(group for group in GROUPS if group in groups)


def calibrate(
    scene: Scene,
    recordings: list[FreeMotion],
    settings: Settings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Estimate the identifiable parameters from contact-free motion, and build a scene with them.

    Args:
        scene: Arm, sensors and prior values.
        recordings: Contact-free motion; the scene's sensors are used where a recording has them.
        settings: What to estimate; None: `default_groups`.
        progress: Called with the name of the next stage.

    Raises:
        CalibrationError: nothing can be estimated from these recordings.
    """
    _check(scene, recordings)
    settings = settings or Settings(default_groups(scene, recordings))
    start = arm = CalibrationModel.of(scene)
    selected = entries(arm, settings.groups, settings.inertia_error)
    solver = _GaussNewton(recordings, scene.bandwidth, selected, start)
    free = np.ones(len(selected), dtype=bool)
    kept: dict[int, str] = {}
    step, condition = None, 1.0
    for number in range(_MAX_ITERATIONS):
        progress(f"round {number + 1}")
        if number == 1 and settings.widths and "coulomb" in settings.groups:
            progress("velocities of the smooth sign functions")
            arm = _best_velocities(arm, recordings, scene.bandwidth)
        arm, step, condition = solver.solve(arm, free, kept, drop_optional=number > 0)
        std = np.sqrt(np.diag(step.covariance))
        if number >= _MIN_ITERATIONS - 1 and np.all(np.abs(step.step[free]) <= _CONVERGED * std[free]):
            break
    assert step is not None
    progress("noise and model error")
    before = [residuals(start, s, scene.bandwidth)[settled_samples(s, scene.bandwidth) :] for s in recordings]
    after = [residuals(arm, s, scene.bandwidth)[settled_samples(s, scene.bandwidth) :] for s in recordings]
    measured = _measured_channels(scene, recordings)
    noise_levels, wrench = _noise(arm, recordings, after, scene.bandwidth)
    values = tuple(
        Value(
            entry,
            value(start, entry),
            value(arm, entry),
            float(np.sqrt(step.covariance[i, i])),
            kept.get(i, ""),
        )
        for i, entry in enumerate(selected)
    )
    warnings = [f"{selected[i].name}: {why}" for i, why in kept.items() if selected[i].group != "links"]
    if scene.joint_torque is not None and noise_levels is not None:
        progress("meaning of the torque signal")
        stride = solver.stride
        warnings = (
            setting_warnings(scene, compare_meanings(scene, recordings, scene.bandwidth, stride)) + warnings
        )
        warnings += [
            f"{joint.name} never stopped or reversed: its uncertainty there is derived from Coulomb friction"
            for joint, rest in zip(scene.robot.joints, noise_levels.rest_error, strict=True)
            if np.isnan(rest)
        ]
    changed = {entry.group for i, entry in enumerate(selected) if free[i]}
    return Calibration(
        scene=scene_of(arm, {str(group) for group in changed}, noise_levels, wrench),
        values=tuple(v for v in values if v.entry.group != "links"),
        inertia=tuple(v for v in values if v.entry.group == "links"),
        warnings=tuple(warnings),
        before=residual_statistics(before, measured),
        after=residual_statistics(after, measured),
        condition=condition,
        covariance=step.covariance,
    )


class _GaussNewton:
    """The Gauss-Newton iterations of one calibration."""

    def __init__(
        self,
        recordings: list[FreeMotion],
        bandwidth: float,
        selected: tuple[Entry, ...],
        start: CalibrationModel,
    ) -> None:
        self._stretches = recordings
        self._bandwidth = bandwidth
        self._chosen = selected
        self._start = np.array([value(start, entry) for entry in selected])
        self._prior = np.array([entry.prior_std for entry in selected])
        self._channels = len(start.gain) + 6
        self.stride = row_stride(recordings, bandwidth)

    def solve(
        self, arm: CalibrationModel, free: np.ndarray, kept: dict[int, str], drop_optional: bool
    ) -> tuple[CalibrationModel, RobustFit, float]:
        """One iteration: the arm at the minimum of the linearized equations.

        Changes `free` and `kept`: parameters that cannot be estimated return to the scene's value.
        """
        rows = [
            row
            for recording in self._stretches
            for row in linearize(arm, recording, self._chosen, self._bandwidth, self.stride)
        ]
        while True:
            offset = np.array([value(arm, entry) for entry in self._chosen]) - self._start
            unexcited = np.array([kept.get(i) == _NOT_EXCITED for i in range(len(free))])
            found = fit_robust(rows, self._prior, offset, free, self._channels, unexcited)
            excited, condition = excited_directions(found.information, self._chosen, free)
            dropped = {int(i): _NOT_EXCITED for i in np.flatnonzero(free & ~excited)}
            if not dropped:
                dropped = self._rejected(arm, found, free, drop_optional)
            if not dropped:
                return apply_step(arm, self._chosen, found.step), found, condition
            kept.update(dropped)
            reset = np.zeros(len(free))
            for i in dropped:
                free[i] = False
                reset[i] = -offset[i]
            if reset.any():
                arm = apply_step(arm, self._chosen, reset)
                for row in rows:
                    row.residual[:] = row.residual + row.slope @ reset[row.columns]

    def _rejected(
        self, arm: CalibrationModel, found: RobustFit, free: np.ndarray, drop_optional: bool
    ) -> dict[int, str]:
        """Parameters that came out invalid or insignificant."""
        rejected: dict[int, str] = {}
        for i in np.flatnonzero(free):
            entry = self._chosen[i]
            estimate = value(arm, entry) + found.step[i]
            std = float(np.sqrt(found.covariance[i, i]))
            if entry.group in NOT_NEGATIVE and estimate < 0.0:
                rejected[int(i)] = f"came out negative ({estimate:.3g} +- {std:.2g} {entry.unit}): kept"
            elif drop_optional and entry.group in OPTIONAL and abs(estimate) < _MIN_SIGNIFICANCE * std:
                rejected[int(i)] = "not significant in the data: kept"
        return rejected


def row_stride(recordings: list[FreeMotion], bandwidth: float) -> int:
    """Number of samples per row kept."""
    rate = max(1.0 / float(np.median(np.diff(recording.t))) for recording in recordings)
    return max(1, round(rate / (_ROWS_PER_PERIOD * bandwidth)))


def _check(scene: Scene, recordings: list[FreeMotion]) -> None:
    if not recordings:
        raise CalibrationError("expected at least one recording of contact-free motion, got none")
    joints = len(scene.robot.joints)
    for recording in recordings:
        if recording.q.shape[1] != joints:
            raise CalibrationError(
                f"{recording.name}: expected {joints} joints, as {scene.robot.name} has, "
                f"got {recording.q.shape[1]}"
            )
        if recording.seconds < 2.0:
            raise CalibrationError(f"{recording.name}: expected at least 2 s, got {recording.seconds:.2g} s")
        if recording.torque is None and recording.reading is None:
            raise CalibrationError(
                f"{recording.name}: expected joint torques or base wrenches as in the scene, got neither"
            )


def _measured_channels(scene: Scene, recordings: list[FreeMotion]) -> np.ndarray:
    torque = any(recording.torque is not None for recording in recordings)
    wrench = any(recording.reading is not None for recording in recordings)
    return np.array([torque] * len(scene.robot.joints) + [wrench] * 6)


def _best_velocities(
    arm: CalibrationModel, recordings: list[FreeMotion], bandwidth: float
) -> CalibrationModel:
    """The arm with the velocities of the smooth sign functions for which friction explains most."""
    selected = entries(arm, ("bias", "coulomb", "viscous", "rotor", "load", "lubricant"), 0.1)
    prior = np.array([entry.prior_std for entry in selected])
    stride = row_stride(recordings, bandwidth)
    torque_only = [
        FreeMotion(recording.t, recording.q, recording.qd, recording.torque, None, recording.name)
        for recording in recordings
        if recording.torque is not None
    ]
    best: tuple[float, CalibrationModel] | None = None
    for velocity, lubricant in product(_VELOCITIES, _LUBRICANT_VELOCITIES):
        candidate = arm.with_values(velocity=velocity, lubricant_velocity=lubricant)
        rows = [
            row
            for recording in torque_only
            for row in linearize(candidate, recording, selected, bandwidth, stride)
        ]
        free = np.ones(len(selected), dtype=bool)
        cost = fit_robust(rows, prior, np.zeros(len(selected)), free, len(arm.gain)).cost
        if best is None or cost < best[0]:
            best = (cost, candidate)
    assert best is not None
    return best[1]


def _noise(
    arm: CalibrationModel, recordings: list[FreeMotion], residual: list[np.ndarray], bandwidth: float
) -> tuple[NoiseLevels | None, tuple[float, float]]:
    """Noise and model error of the joints, and noise of the base sensor that includes its model error."""
    joints = len(arm.gain)
    dt = float(np.median(np.concatenate([np.diff(recording.t) for recording in recordings])))
    variance_ratio = noise_variance_ratio(bandwidth, dt)
    noise_levels, wrench = None, (np.nan, np.nan)
    pairs = list(zip(recordings, residual, strict=True))
    with_torque = [(s, r[:, :joints]) for s, r in pairs if s.torque is not None]
    if with_torque:
        friction_torques = [friction(arm, s)[-len(r) :] for s, r in with_torque]
        noise_levels = estimate_noise(
            [r for _, r in with_torque],
            [s.qd[-len(r) :] for s, r in with_torque],
            friction_torques,
            dt,
            variance_ratio,
        )
    base = [r[:, joints:] for s, r in pairs if s.reading is not None]
    if base:
        sensor = arm.scene.base_wrench
        assert sensor is not None
        # The residual is about the base origin; the sensor's noise about its own.
        transfer = wrench_transform(np.eye(3), np.array(sensor.translation) + arm.shift)
        about_sensor = np.vstack(base) @ np.linalg.inv(transfer).T
        rms = np.sqrt(np.mean(about_sensor**2, axis=0) / variance_ratio)
        wrench = (float(np.max(rms[:3])), float(np.max(rms[3:])))
    return noise_levels, wrench
