"""Gauss-Newton on the residuals of the momentum observer.

Each iteration linearizes all equations, determines which parameters the motion excites, and solves for those.
The velocities of the smooth sign functions of friction enter nonlinearly and are chosen from a grid. Friction
coefficients and rotors that come out negative are zero; the others are the best ones under that condition.
The covariance is that without it: the truth keeps the condition, so that it only brings an estimate nearer.
Optional parameters without significance are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.identifiability import excited_directions
from contactsense.calibration.fit.robust_least_squares import fit_robust
from contactsense.calibration.fit.sandwich_covariance import sandwich_covariance
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import NOT_NEGATIVE, OPTIONAL, Entry, apply_step, entries, value
from contactsense.calibration.residuals.equations import channels, linearize_all
from contactsense.calibration.residuals.residual_jacobian import Rows, linearize

_MIN_ITERATIONS, _MAX_ITERATIONS = 3, 12
_CONVERGED = 0.1
"""Iterations continue until no parameter changes by more than this fraction of its standard deviation. Torque
constants multiply the measurement, so they may need several."""
_MIN_SIGNIFICANCE = 2.5
"""Load-dependent and lubricant friction and a tilt are used if they differ from zero by this many standard
deviations."""
_VELOCITIES = (0.002, 0.005, 0.01, 0.02, 0.05)
_LUBRICANT_VELOCITIES = (0.1, 0.2, 0.4)

NOT_ESTIMATED = (": kept", ": 0 is used")
"""How the reason ends for which a parameter is not the best estimate: it keeps the scene's value, or is zero.
"""
_NOT_EXCITED = f"not excited by this motion{NOT_ESTIMATED[0]}"


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
    """Why each of the others keeps the scene's value, unless it is in `at_zero`."""
    at_zero: dict[int, str]
    """Why each of those is zero that would be negative."""
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
    choice = _Choice(np.ones(len(selected), dtype=bool))
    arm, last = start, None
    for number in range(_MAX_ITERATIONS):
        progress(f"round {number + 1}")
        if number < _MIN_ITERATIONS:
            choice.reconsider()
        if number == 1 and widths and any(entry.group == "coulomb" for entry in selected):
            progress("velocities of the smooth sign functions")
            arm = _best_velocities(arm, recordings, bandwidth)
        last = solver.solve(arm, choice, drop_optional=number > 0)
        arm, std, free = last.arm, np.sqrt(np.diag(last.covariance)), choice.free
        if number >= _MIN_ITERATIONS - 1 and np.all(np.abs(last.step[free]) <= _CONVERGED * std[free]):
            break
    assert last is not None
    precision = last.information + np.diag([entry.prior_std**-2 for entry in selected])
    covariance = solver.covariance(arm, choice) if choice.at_zero else last.covariance
    return FittedModel(arm, covariance, precision, choice.free, choice.kept, choice.at_zero, last.condition)


@dataclass(frozen=True)
class _Iteration:
    """Result of one iteration. k parameters."""

    arm: CalibrationModel
    """At the minimum of the linearized equations."""
    step: np.ndarray
    """Change of the parameters, shape (k,)."""
    covariance: np.ndarray
    """Of the parameters, shape (k, k)."""
    information: np.ndarray
    """Information matrix of the data, without the prior, shape (k, k)."""
    condition: float
    """Condition number of the scaled regressor of the estimated parameters."""


@dataclass
class _Choice:
    """Which parameters are estimated."""

    free: np.ndarray
    """Shape (k,), bool."""
    kept: dict[int, str] = field(default_factory=dict)
    at_zero: dict[int, str] = field(default_factory=dict)
    """As in `FittedModel`."""

    @property
    def unexcited(self) -> np.ndarray:
        """Those that the motion does not excite, shape (k,), bool."""
        return np.array([self.kept.get(i) == _NOT_EXCITED for i in range(len(self.free))])

    def reconsider(self) -> None:
        """Estimate again what the residuals of the last iteration left unexcited or made negative: far from
        the minimum they are so large that the motion seems to tell little."""
        for i in [*np.flatnonzero(self.unexcited), *self.at_zero]:
            self.free[i] = True
            self.kept.pop(int(i), None)
        self.at_zero.clear()


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

    def solve(self, arm: CalibrationModel, choice: _Choice, drop_optional: bool) -> _Iteration:
        """One iteration.

        Changes `choice`: parameters that cannot be estimated return to the scene's value or to zero.
        """
        rows = self._rows(arm)
        while True:
            offset = self._values(arm) - self._start
            found = fit_robust(rows, self._prior, offset, choice.free, self._channels)
            excited, condition = excited_directions(found.information, self._chosen, choice.free)
            dropped = {int(i): _NOT_EXCITED for i in np.flatnonzero(choice.free & ~excited)}
            at_zero: dict[int, str] = {}
            if not dropped:
                covariance = sandwich_covariance(rows, found, self._prior, choice.free, choice.unexcited)
                std = np.sqrt(np.diag(covariance))
                dropped, at_zero = self._rejected(arm, found.step, std, choice.free, drop_optional)
            if not (dropped or at_zero):
                next_arm = apply_step(arm, self._chosen, found.step)
                return _Iteration(next_arm, found.step, covariance, found.information, condition)
            choice.kept.update(dropped)
            choice.at_zero.update(at_zero)
            reset = np.zeros(len(choice.free))
            reset[list(dropped)] = -offset[list(dropped)]
            reset[list(at_zero)] = -self._values(arm)[list(at_zero)]
            choice.free[[*dropped, *at_zero]] = False
            if reset.any():
                arm = apply_step(arm, self._chosen, reset)
                for row in rows:
                    row.residual[:] = row.residual + row.slope @ reset[row.columns]

    def covariance(self, arm: CalibrationModel, choice: _Choice) -> np.ndarray:
        """Covariance of the parameters about their estimates if those at zero could be negative, shape
        (k, k)."""
        free = choice.free.copy()
        free[list(choice.at_zero)] = True
        offset = self._values(arm) - self._start
        rows = self._rows(arm)
        found = fit_robust(rows, self._prior, offset, free, self._channels)
        return sandwich_covariance(rows, found, self._prior, free, choice.unexcited)

    def _rows(self, arm: CalibrationModel) -> list[Rows]:
        return [
            row
            for recording in self._stretches
            for row in linearize_all(arm, recording, self._chosen, self._bandwidth)
        ]

    def _values(self, arm: CalibrationModel) -> np.ndarray:
        return np.array([value(arm, entry) for entry in self._chosen])

    def _rejected(
        self,
        arm: CalibrationModel,
        step: np.ndarray,
        std: np.ndarray,
        free: np.ndarray,
        drop_optional: bool,
    ) -> tuple[dict[int, str], dict[int, str]]:
        """Parameters that came out invalid or insignificant: those that keep the scene's value, and those
        that are zero. Of each joint only the most negative one is zero, as the others follow it."""
        kept: dict[int, str] = {}
        worst: dict[int | None, tuple[float, int, str]] = {}
        for i in map(int, np.flatnonzero(free)):
            entry = self._chosen[i]
            estimate = value(arm, entry) + float(step[i])
            error = float(std[i])
            is_negative = entry.group in NOT_NEGATIVE and estimate < 0.0
            is_optional = entry.group in OPTIONAL
            is_small = is_optional and drop_optional and abs(estimate) < _MIN_SIGNIFICANCE * error
            if not (is_negative or is_small):
                continue
            text = f"came out negative ({estimate:.3g} +- {error:.2g} {entry.unit})"
            if is_optional and abs(estimate - self._start[i]) < _MIN_SIGNIFICANCE * error:
                kept[i] = f"not significant in the data{NOT_ESTIMATED[0]}"
            elif is_optional and self._start[i] == 0.0:
                kept[i] = text + NOT_ESTIMATED[0]
            else:
                text = text if is_negative else "not significant in the data"
                worst[entry.joint] = min(
                    worst.get(entry.joint, (np.inf, i, "")), (estimate / error, i, text + NOT_ESTIMATED[1])
                )
        return kept, {i: text for _, i, text in worst.values()}


def _best_velocities(
    arm: CalibrationModel, recordings: list[FreeMotion], bandwidth: float
) -> CalibrationModel:
    """The arm with the velocities of the smooth sign functions for which friction explains most."""
    selected = entries(arm, ("bias", "coulomb", "viscous", "rotor", "load", "lubricant"))
    prior = np.array([entry.prior_std for entry in selected])
    torque_only = [recording.with_readings({}) for recording in recordings if recording.torque is not None]
    free = np.ones(len(selected), dtype=bool)

    def cost(candidate: CalibrationModel) -> float:
        rows = [
            row for recording in torque_only for row in linearize(candidate, recording, selected, bandwidth)
        ]
        return fit_robust(rows, prior, np.zeros(len(selected)), free, len(arm.gain)).cost

    pairs = product(_VELOCITIES, _LUBRICANT_VELOCITIES)
    return min((arm.with_values(velocity=v, lubricant_velocity=l) for v, l in pairs), key=cost)  # noqa: E741
