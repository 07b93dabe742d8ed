"""Gauss-Newton on the residuals of the momentum observer.

Each iteration linearizes all equations, determines which parameters the motion excites, and solves for those.
The velocities of the smooth sign functions of friction enter nonlinearly and are chosen from a grid. Friction
coefficients that come out negative and optional parameters without significance are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.equations import channels, linearize_all
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.identifiability import excited_directions
from contactsense.calibration.parameters import NOT_NEGATIVE, OPTIONAL, Entry, apply_step, entries, value
from contactsense.calibration.residual_jacobian import linearize
from contactsense.calibration.robust_least_squares import RobustFit, fit_robust

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

_NOT_EXCITED = "not excited by this motion: kept"


@dataclass(frozen=True)
class FittedModel:
    """Result of the iterations. k parameters."""

    arm: CalibrationModel
    covariance: np.ndarray
    """Of the parameters, shape (k, k)."""
    precision: np.ndarray
    """Of the parameters by the last linearized equations and the prior, shape (k, k)."""
    free: np.ndarray
    """Which parameters were estimated, shape (k,), bool."""
    kept: dict[int, str]
    """Why each of the others keeps the scene's value."""
    condition: float
    """Condition number of the scaled regressor of the estimated parameters."""


def fit_model(
    start: CalibrationModel,
    recordings: list[FreeMotion],
    selected: tuple[Entry, ...],
    widths: bool,
    progress: Callable[[str], None],
) -> FittedModel:
    """Fit the selected parameters to the usable samples of the recordings.

    Args:
        start: The scene's values.
        recordings: Contact-free motion.
        selected: The parameters.
        widths: Whether to choose the velocities of friction's smooth sign functions, too.
        progress: Called with the name of the next stage.
    """
    bandwidth = start.scene.bandwidth
    solver = _GaussNewton(recordings, bandwidth, selected, start)
    free = np.ones(len(selected), dtype=bool)
    kept: dict[int, str] = {}
    arm, step, condition = start, None, 1.0
    for number in range(_MAX_ITERATIONS):
        progress(f"round {number + 1}")
        if number < _MIN_ITERATIONS:
            _reconsider(free, kept)
        if number == 1 and widths and any(entry.group == "coulomb" for entry in selected):
            progress("velocities of the smooth sign functions")
            arm = _best_velocities(arm, recordings, bandwidth)
        arm, step, condition = solver.solve(arm, free, kept, drop_optional=number > 0)
        std = np.sqrt(np.diag(step.covariance))
        if number >= _MIN_ITERATIONS - 1 and np.all(np.abs(step.step[free]) <= _CONVERGED * std[free]):
            break
    assert step is not None
    precision = step.information + np.diag([entry.prior_std**-2 for entry in selected])
    return FittedModel(arm, step.covariance, precision, free, kept, condition)


def _reconsider(free: np.ndarray, kept: dict[int, str]) -> None:
    """Estimate again what the residuals of the last iteration left unexcited: far from the minimum they are
    so large that the motion seems to tell little."""
    for i in [i for i, why in kept.items() if why == _NOT_EXCITED]:
        free[i] = True
        del kept[i]


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
        self._channels = channels(start.scene)
        self._stride = row_stride(recordings, bandwidth)

    def solve(
        self, arm: CalibrationModel, free: np.ndarray, kept: dict[int, str], drop_optional: bool
    ) -> tuple[CalibrationModel, RobustFit, float]:
        """One iteration: the arm at the minimum of the linearized equations.

        Changes `free` and `kept`: parameters that cannot be estimated return to the scene's value.
        """
        rows = [
            row
            for recording in self._stretches
            for row in linearize_all(arm, recording, self._chosen, self._bandwidth, self._stride)
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


def _best_velocities(
    arm: CalibrationModel, recordings: list[FreeMotion], bandwidth: float
) -> CalibrationModel:
    """The arm with the velocities of the smooth sign functions for which friction explains most."""
    selected = entries(arm, ("bias", "coulomb", "viscous", "rotor", "load", "lubricant"))
    prior = np.array([entry.prior_std for entry in selected])
    stride = row_stride(recordings, bandwidth)
    torque_only = [recording.with_readings({}) for recording in recordings if recording.torque is not None]
    free = np.ones(len(selected), dtype=bool)

    def cost(candidate: CalibrationModel) -> float:
        rows = [
            row
            for recording in torque_only
            for row in linearize(candidate, recording, selected, bandwidth, stride)
        ]
        return fit_robust(rows, prior, np.zeros(len(selected)), free, len(arm.gain)).cost

    pairs = product(_VELOCITIES, _LUBRICANT_VELOCITIES)
    return min((arm.with_values(velocity=v, lubricant_velocity=l) for v, l in pairs), key=cost)  # noqa: E741
