"""How well a setup explains the readings, and the best values of some of its parameters.

Biases, joint friction, rotors and the links' inertia are nuisances: linear, with priors about what is known
of them, and solved for in every fit. The standard deviation sigma_c of each of the C channels is
unknown and estimated. With N_c effective rows, twice the negative log posterior at its maximum is

    cost = sum_c N_c ln(sigma_c^2)  +  penalty of the nuisances  +  k ln(sum_c N_c),

with the penalty of the Bayesian information criterion for k free parameters (G. Schwarz, "Estimating the
dimension of a model", Annals of Statistics 1978). Differences of costs compare setups.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.sensors.settings import per_joint
from contactsense.setup_check.motion_basis import MotionBases, Readings
from contactsense.setup_check.setup import SIZES, Free, Setup

_BIAS_FORCE, _BIAS_MOMENT = 50.0, 20.0
"""Scale of the prior of the base sensor's bias [N, Nm]. It is a Cauchy prior, with penalty 2 ln(1 + x^2): a
sensor that was set to zero under the arm's weight has a bias far beyond the scale, and no other line is
wrong."""
_WRIST_BIAS_FORCE, _WRIST_BIAS_MOMENT = 20.0, 2.0
"""The same for the wrist sensor."""
_TORQUE_PART = 0.1
"""Prior standard deviation of bias, friction and rotors, per torque limit of the joint."""
_INERTIA_ERROR = 0.05
"""Prior standard deviation of the links' masses, relative: a maker's data, cables and covers."""
_WRIST_NUISANCES = 16
"""Inertia of the tool, and the six biases."""
_SMALLEST_SIGMA = 0.1
"""The noise is at least this fraction of what the scene states."""
_WEIGHTINGS = 4
_STEPS = 6
_STEP_LIMIT: dict[Free, float] = {
    "tilt": 0.5, "turn": 0.5, "shift": 0.3, "delay": 0.03, "mass": 10.0, "com": 0.3, "wrist_turn": 0.5,
    "wrist_shift": 0.3,
}  # fmt: skip
"""Largest change of a parameter in one iteration."""
_PRIOR: dict[Free, float] = {
    "tilt": 1.0, "turn": 1.0, "shift": 0.5, "delay": 0.1, "mass": 20.0, "com": 0.5, "wrist_turn": 1.0,
    "wrist_shift": 0.5,
}  # fmt: skip
"""Scale of each parameter, far beyond what can be expected; a prior about the last iterate."""


@dataclass(frozen=True)
class Fit:
    """A setup at its best values. C channels: n joints, six of the base sensor, six of the wrist sensor."""

    setup: Setup
    free: tuple[Free, ...]
    """Groups that were estimated."""
    variance: np.ndarray
    """Of each measured channel's residual, shape (C',) [Nm^2, or N^2 and Nm^2]."""
    penalty: float
    """Of the nuisances, by their priors."""
    std: np.ndarray
    """Standard deviations of the free parameters, with all nuisances unknown, shape (k,)."""
    residual: np.ndarray
    """Of each row, shape (M, C) [Nm, or N and Nm]; NaN for a missing sensor."""
    wrist_bias: np.ndarray
    """Bias of the wrist sensor beyond the setup's, as read, shape (6,) [N, Nm]; zeros without it."""
    wrist_bias_std: np.ndarray
    """Its standard deviations, all else that is estimated unknown."""


class Fitter:
    """Fits setups to one set of recordings."""

    def __init__(self, scene: Scene, bases: MotionBases, readings: Readings) -> None:
        self._bases, self._readings = bases, readings
        joints = scene.robot.joints
        self._joints = n = len(joints)
        limit = _TORQUE_PART * np.array([joint.torque_limit for joint in joints])
        self._drive_prior = limit
        self._inertia_error = max(_INERTIA_ERROR, scene.inertia_error)
        base, torque = scene.base_wrench or WrenchSensor(), scene.joint_torque or JointTorqueSensor()
        wrist = scene.wrist_wrench or WrenchSensor()
        stated = np.concatenate(
            (
                per_joint(torque.noise, n),
                np.repeat([base.force_noise, base.moment_noise], 3),
                np.repeat([wrist.force_noise, wrist.moment_noise], 3),
            )
        )
        self._floor = (_SMALLEST_SIGMA * stated) ** 2 * readings.variance_ratio
        there = [x is not None for x in (readings.torque, readings.wrench, readings.wrist)]
        measured = np.repeat(there, [n, 6, 6])
        self._has_wrist = there[2]
        self._channels = np.flatnonzero(measured)
        self._wrist_scale = np.repeat([_WRIST_BIAS_FORCE, _WRIST_BIAS_MOMENT], 3)
        self._last: tuple[object, np.ndarray] | None = None
        self.effective = np.ones(len(measured))
        """Independent rows per row, of each channel."""
        self.noise = stated * float(np.sqrt(readings.variance_ratio))
        """Standard deviation of each filtered channel as the scene states it, shape (n + 12,) [Nm, N, Nm]."""

    def fit(self, start: Setup, free: tuple[Free, ...] = (), steps: int = _STEPS) -> Fit:
        """The best setup near `start`, with the parameters in `free` estimated."""
        k = sum(SIZES[name] for name in free)
        prior = np.concatenate([np.full(SIZES[name], _PRIOR[name]) for name in free] or [np.zeros(0)])
        limit = np.concatenate([np.full(SIZES[name], _STEP_LIMIT[name]) for name in free] or [np.zeros(0)])
        setup, best = start, self._solve(start, np.zeros((0, 0, 0)), prior)
        if not free:
            return self._result(setup, free, prior, best)
        for _ in range(steps):
            slopes = self._slopes(setup, free, prior)
            solved = self._solve(setup, slopes, prior)
            step = np.clip(solved.values[:k], -limit, limit)
            for _ in range(4):
                moved = setup.moved(free, step)
                found = self._solve(moved, np.zeros((0, 0, 0)), prior)
                if found.cost <= best.cost:
                    break
                step = 0.3 * step
            else:
                break
            gain, setup, best = best.cost - found.cost, moved, found
            if gain < 0.01:
                break
        last = self._solve(setup, self._slopes(setup, free, prior), prior)
        return self._result(setup, free, prior, last, best)

    def cost(self, fit: Fit) -> float:
        """See the module."""
        rows = len(fit.residual) * self.effective[self._channels]
        k = sum(SIZES[name] for name in fit.free)
        return float(rows @ np.log(fit.variance)) + fit.penalty + k * float(np.log(rows.sum()))

    def set_effective_rows(self, residual: np.ndarray) -> None:
        """Reduce the number of rows by the correlation of neighbouring residuals.

        That of a first-order autoregressive process: (1 - r) / (1 + r) of the rows are independent.
        """
        for c in self._channels:
            r = residual[:, c] - residual[:, c].mean()
            correlation = float(r[1:] @ r[:-1]) / max(float(r @ r), 1e-300)
            self.effective[c] = np.clip((1.0 - correlation) / (1.0 + correlation), 0.05, 1.0)

    def _slopes(self, setup: Setup, free: tuple[Free, ...], prior: np.ndarray) -> np.ndarray:
        """Derivatives of the prediction by the free parameters, shape (M, C, k)."""
        here, steps = self._error(setup), 1e-3 * np.diag(prior)
        slopes = [(here - self._error(setup.moved(free, step))) / step.sum() for step in steps]
        return np.stack(slopes, axis=-1)

    def _error(self, setup: Setup) -> np.ndarray:
        """Readings minus prediction without nuisances, shape (M, C)."""
        per_body = self._per_body(setup)
        predicted = np.einsum("mclp,lp->mc", per_body, setup.bodies)
        n = self._joints
        error = np.full((len(predicted), n + 12), np.nan)
        if self._readings.torque is not None:
            error[:, :n] = self._readings.torque - setup.gain * predicted[:, :n]
        if self._readings.wrench is not None:
            wrench = predicted[:, n:] @ setup.base.reading_per_wrench.T
            error[:, n : n + 6] = self._readings.wrench - wrench - setup.base.bias
        if self._readings.wrist is not None:
            wrench = self._per_tool(setup) @ setup.tool @ setup.wrist.reading_per_wrench.T
            error[:, n + 6 :] = self._readings.wrist - wrench - setup.wrist.bias
        return error

    def _per_tool(self, setup: Setup) -> np.ndarray:
        """Wrench on the wrist sensor per inertial parameter of the tool, shape (M, 6, 10)."""
        return self._bases.of(setup.robot, setup.angle_unit).wrist(setup.gravity)

    def _per_body(self, setup: Setup) -> np.ndarray:
        """Torques and wrench per inertial parameter, shape (M, n + 6, L, 10)."""
        # Most changes of a setup leave these terms as they are.
        key = (setup.robot, setup.angle_unit, setup.meaning, setup.delay, setup.gravity.tobytes())
        if self._last is None or self._last[0] != key:
            basis = self._bases.of(setup.robot, setup.angle_unit)
            contains = setup.meaning == "motor", setup.meaning != "external"
            joints, base = basis.joints(setup.gravity, *contains), basis.base(setup.gravity, setup.delay)
            self._last = key, np.concatenate((joints, base), axis=1)
        return self._last[1]

    def _nuisances(self, setup: Setup) -> np.ndarray:
        """Derivatives of the prediction by the nuisances in units of their priors, shape (M, C, P)."""
        basis, n = self._bases.of(setup.robot, setup.angle_unit), self._joints
        links = self._per_body(setup)[:, :, 1:]  # the base does not move
        rows = links.shape[0]
        links = links * (self._inertia_error * _link_sizes(setup.links[1:]))
        links = links.reshape(rows, n + 6, -1)
        links[:, :n] *= setup.gain[:, None]
        links[:, n:] = np.einsum("ij,mjp->mip", setup.base.reading_per_wrench, links[:, n:])
        own = np.zeros((rows, n + 6, 4 * n + 6))
        frictional = 0.0 if setup.meaning == "external" else 1.0
        for j in range(n):
            scale = setup.gain[j] * self._drive_prior[j]
            own[:, j, 4 * j] = scale
            own[:, j, 4 * j + 1] = frictional * scale * basis.coulomb[:, j]
            own[:, j, 4 * j + 2] = frictional * scale * basis.viscous[:, j]
            own[:, j, 4 * j + 3] = frictional * 0.3 * scale * basis.rotor[:, j]
        own[:, n:, 4 * n :] = setup.base.order * np.repeat([_BIAS_FORCE, _BIAS_MOMENT], 3)
        columns = np.concatenate((links, own), axis=2)
        first = columns.shape[2]
        found = np.zeros((rows, n + 12, first + _WRIST_NUISANCES * self._has_wrist))
        found[:, : n + 6, :first] = columns
        if self._has_wrist:
            sensor = setup.wrist
            tool = self._per_tool(setup) * (self._inertia_error * _link_sizes(setup.tool[None])[0])
            found[:, n + 6 :, first:-6] = np.einsum("ij,mjp->mip", sensor.reading_per_wrench, tool)
            found[:, n + 6 :, -6:] = sensor.order * self._wrist_scale
        return found

    def _solve(self, setup: Setup, slopes: np.ndarray, prior: np.ndarray) -> "_Solved":
        """Nuisances, and the free parameters if `slopes` has any, by iteratively weighted least squares."""
        error, columns = self._error(setup), self._nuisances(setup)
        k = slopes.shape[-1] if slopes.size else 0
        if k:
            columns = np.concatenate((slopes * prior, columns), axis=2)
        y = error[:, self._channels].T
        A = np.ascontiguousarray(columns[:, self._channels].transpose(1, 0, 2))
        floor, rows = self._floor[self._channels], y.shape[1]
        weight = self.effective[self._channels]
        # The biases' columns: the base sensor's, before the tool and the wrist sensor's, or last.
        last = A.shape[2]
        biases = np.arange(last - 6, last)
        if self._has_wrist:
            biases = np.concatenate((biases - _WRIST_NUISANCES, biases))
        G, b = A.transpose(0, 2, 1) @ A, np.einsum("cmp,cm->cp", A, y)
        variance = np.maximum(y.var(axis=1), floor)
        values, precision = np.zeros(A.shape[2]), np.ones(A.shape[2])
        H, residual = np.diag(precision), y
        for _ in range(_WEIGHTINGS):
            precision[biases] = 2.0 / (1.0 + values[biases] ** 2)
            H = np.tensordot(weight / variance, G, 1) + np.diag(precision)
            values = np.linalg.solve(H, (weight / variance) @ b)
            residual = y - A @ values
            variance = np.maximum(np.mean(residual**2, axis=1), floor)
        full = np.full(error.shape, np.nan)
        full[:, self._channels] = residual.T
        gaussian = np.delete(values, biases)[k:]
        penalty = float(gaussian @ gaussian + 2.0 * np.log1p(values[biases] ** 2).sum())
        cost = rows * float(weight @ np.log(variance)) + penalty
        scaled = values.copy()
        scaled[:k] *= prior[:k]
        return _Solved(cost, penalty, variance, scaled, H, full)

    def _result(
        self,
        setup: Setup,
        free: tuple[Free, ...],
        prior: np.ndarray,
        solved: "_Solved",
        at: "_Solved | None" = None,
    ) -> Fit:
        at = at or solved
        spread = np.sqrt(np.diag(np.linalg.inv(solved.precision)))
        bias = bias_std = np.zeros(6)
        if self._has_wrist:
            order = setup.wrist.order * self._wrist_scale
            bias, bias_std = order @ at.values[-6:], np.abs(order) @ spread[-6:]
        std = spread[: len(prior)] * prior
        return Fit(setup, free, at.variance, at.penalty, std, at.residual, bias, bias_std)


@dataclass(frozen=True)
class _Solved:
    cost: float
    penalty: float
    variance: np.ndarray
    values: np.ndarray
    """Free parameters, then nuisances in units of their priors."""
    precision: np.ndarray
    """Of the same, both in units of their priors."""
    residual: np.ndarray


def _link_sizes(links: np.ndarray) -> np.ndarray:
    """Scale of each inertial parameter by the link's mass and radius of gyration, shape (L, 10)."""
    mass = links[:, 0]
    size = np.sqrt(np.maximum(links[:, [4, 6, 9]].sum(axis=1), 1e-6) / (2.0 * np.maximum(mass, 1e-3)))
    return np.column_stack([mass] + [mass * size] * 3 + [mass * size**2] * 6)
