"""How well a setup explains the readings, and the best values of some of its parameters.

Biases, joint friction, rotors and the links' inertia are nuisances: linear, with priors about what is known
of them, and solved for in every fit. The standard deviation sigma_c of each of the C channels is
unknown and estimated. With N_c effective rows, of those in which the channel is measured, twice the negative
log posterior at its maximum is

    cost = sum_c N_c ln(sigma_c^2)  +  penalty of the nuisances  +  k ln(sum_c N_c),

with the penalty of the Bayesian information criterion for k free parameters (G. Schwarz, "Estimating the
dimension of a model", Annals of Statistics 1978). Differences of costs compare setups.

How well a load on a link is determined depends on the prior of the links' inertia, hardly on the number of
rows. Each of its parameters is charged 2 ln(scale of its prior / standard deviation) instead of
ln(sum_c N_c), as in Laplace's approximation of the evidence (R. E. Kass, A. E. Raftery, "Bayes factors",
Journal of the American Statistical Association 1995).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from contactsense.calibration.parameters import inertial_scales
from contactsense.robots.torque_scale import torque_scales
from contactsense.scene import JointTorqueSensor, Scene
from contactsense.sensors.settings import per_joint
from contactsense.setup_check.fit.equations import Equations, bordered, products
from contactsense.setup_check.fit.place_jacobian import place_jacobian
from contactsense.setup_check.fit.solution import Solution
from contactsense.setup_check.fit.term_memory import TermMemory
from contactsense.setup_check.lines import wrench_fields
from contactsense.setup_check.setup import BASE, Free, Kind, Order, Setup, in_order
from contactsense.setup_check.terms.motion_basis import MotionBases, MotionBasis, Readings

_BASE_BIAS = np.repeat([50.0, 20.0], 3)
"""Scale of the prior of the base sensor's bias [N, Nm]. It is a Cauchy prior, with penalty 2 ln(1 + x^2): a
sensor that was set to zero under the arm's weight has a bias far beyond the scale, and no other line is
wrong."""
_LINK_BIAS = np.repeat([20.0, 2.0], 3)
"""The same for a sensor within the arm."""
_TORQUE_PART = 0.1
"""Prior standard deviation of bias, friction and rotors, per torque limit of the joint."""
_INERTIA_ERROR = 0.05
"""Prior standard deviation of the links' masses, relative: a maker's data, cables and covers."""
_SMALLEST_SIGMA = 0.1
"""The noise is at least this fraction of what the scene states."""
_WEIGHTINGS = 4
_STEPS = 6
_PLACED = 1e-4
"""A sensor is in its place if the next step is shorter [m]."""
_STEP_LIMIT: dict[Kind, float] = {
    "zero": 0.3, "tilt": 0.5, "mass": 10.0, "com": 0.3, "load": 3.0, "place": 0.3,
    "turn": 0.5, "shift": 0.3, "delay": 0.03, "lag": 0.03,
    "force": 0.7, "moment": 0.7, "wrench": 0.7, "gain": 0.7,
}  # fmt: skip
"""Largest change of a parameter in one iteration."""
_PRIOR: dict[Kind, float] = {
    "zero": 1.0, "tilt": 1.0, "mass": 20.0, "com": 0.5, "load": 5.0, "place": 0.3,
    "turn": 1.0, "shift": 0.5, "delay": 0.1, "lag": 0.1,
    "force": 1.0, "moment": 1.0, "wrench": 1.0, "gain": 1.0,
}  # fmt: skip
"""Scale of each parameter, far beyond what can be expected; a prior about the last iterate."""


@dataclass(frozen=True)
class Fit:
    """A setup at its best values. C channels: n joints, and six of each force/torque sensor of the scene."""

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
    """Of each row, shape (M, C) [Nm, or N and Nm]; NaN where a recording lacks the sensor."""
    bias: Mapping[str, tuple[np.ndarray, np.ndarray]]
    """Of each measured force/torque sensor, by field: its bias beyond the setup's, as read, shape (6,) [N,
    Nm], and the standard deviations, all else that is estimated unknown."""

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of each channel's residual, shape (C,) [Nm, or N and Nm]; NaN: not measured."""
        count = np.isfinite(self.residual).sum(axis=0)
        return np.asarray(np.sqrt(np.nansum(self.residual**2, axis=0) / np.where(count > 0, count, np.nan)))


class Fitter:
    """Fits setups to one set of recordings."""

    def __init__(self, scene: Scene, bases: MotionBases, readings: Readings) -> None:
        self._bases, self._readings = bases, readings
        joints = scene.robot.joints
        self._joints = n = len(joints)
        self.joint_names = tuple(joint.name for joint in joints)
        self._drive_prior = _TORQUE_PART * torque_scales(scene.robot)
        self._inertia_error = max(_INERTIA_ERROR, scene.inertia_error)
        torque = scene.joint_torque or JointTorqueSensor()
        base = () if scene.base_wrench is None else (scene.base_wrench,)
        noise = [
            (sensor.force_noise, sensor.moment_noise) for sensor in (*base, *scene.link_sensors.values())
        ]
        stated = np.concatenate([per_joint(torque.noise, n), *(np.repeat(pair, 3) for pair in noise)])
        self._floor = (_SMALLEST_SIGMA * stated) ** 2 * readings.variance_ratio
        self._fields = wrench_fields(scene)
        measured = readings.measured(n, self._fields)
        self._channels = np.flatnonzero(measured.any(axis=1))
        self._measured = measured[self._channels]
        self._counts = self._measured.sum(axis=1)
        self._terms = TermMemory()
        self._stated: tuple[Setup, Equations] | None = None
        self.effective = np.ones(len(measured))
        """Independent rows per row, of each channel."""
        self.noise = stated * float(np.sqrt(readings.variance_ratio))
        """Standard deviation of each channel, filtered and averaged, as the scene states it, shape (C,)
        [Nm, N, Nm]."""

    def fit(self, start: Setup, free: tuple[Free, ...] = (), steps: int = _STEPS) -> Fit:
        """The best setup near `start`, with the parameters in `free` estimated."""
        sizes = [group.size for group in free]
        k = sum(sizes)
        prior = np.repeat([_PRIOR[group.kind] for group in free], sizes)
        limit = np.repeat([_STEP_LIMIT[group.kind] for group in free], sizes)
        setup, best = start, self._solve(start, np.zeros((0, 0, 0)), prior)
        if not free:
            return self._result(setup, free, prior, best)
        if all(group.kind == "shift" for group in free):
            setup = self._placed(start, free, prior, limit, steps)
            steps, best = 0, self._solve(setup, np.zeros((0, 0, 0)), prior)
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

    def _placed(
        self, start: Setup, free: tuple[Free, ...], prior: np.ndarray, limit: np.ndarray, steps: int
    ) -> Setup:
        """The setup with the sensors where the errors of their moments are not correlated with
        `place_jacobian` (instrumental variables); the cost may be smaller elsewhere. `start` if the steps do
        not become shorter."""
        setup, lengths = start, []
        for _ in range(steps):
            solved = self._solve(setup, self._slopes(setup, free, prior), prior)
            step = np.clip(solved.values[: len(prior)], -limit, limit)
            setup = setup.moved(free, step)
            lengths.append(float(np.abs(step).max()))
            if lengths[-1] < _PLACED:
                return setup
        return setup if lengths and lengths[-1] < lengths[0] else start

    def cost(self, fit: Fit) -> float:
        """See the module."""
        return self._cost(fit.variance, fit.penalty, fit.free, fit.std)

    def predicted_cost(self, start: Setup, free: tuple[Free, ...]) -> float:
        """The cost to expect of `fit`: that after its first step, if the prediction were linear."""
        prior = np.repeat([_PRIOR[group.kind] for group in free], [group.size for group in free])
        slopes = self._slopes(start, free, prior) if free else np.zeros((0, 0, 0))
        solved = self._solve(start, slopes, prior)
        std = solved.spread[: len(prior)] * prior
        return self._cost(solved.variance, solved.penalty, free, std)

    def _cost(self, variance: np.ndarray, penalty: float, free: tuple[Free, ...], std: np.ndarray) -> float:
        rows = self._counts * self.effective[self._channels]
        sizes = [group.size for group in free]
        scale = np.repeat([_PRIOR[group.kind] for group in free], sizes)
        of_load = np.repeat([group.link is not None for group in free], sizes).astype(bool)
        charge = np.where(of_load, 2.0 * np.log(scale / std), np.log(rows.sum()))
        return float(rows @ np.log(variance)) + penalty + float(charge.sum())

    def offset(self, setup: Setup, field: str) -> np.ndarray:
        """What a force/torque sensor reads beyond the prediction without nuisances, as read, shape (6,)
        [N, Nm]: the median, which a short contact does not change; NaN where it is missing."""
        own = self._equations(setup).error[:, self._of(field)]
        known = np.isfinite(own).all(axis=1)
        return np.asarray(np.median(own[known], axis=0)) if known.any() else np.full(6, np.nan)

    def friction(self, setup: Setup) -> tuple[np.ndarray, np.ndarray] | None:
        """Coulomb friction of each joint, shape (n,) [Nm], and the standard deviations; None without joint
        torques that contain it."""
        if self._readings.torque is None or setup.meaning == "external":
            return None
        solved = self._solve(setup, np.zeros((0, 0, 0)), np.zeros(0))
        sums = np.zeros((len(solved.values), self._joints))
        for j, size in enumerate(self._drive_prior):
            first = 10 * (len(setup.links) - 1) + 5 * j
            sums[first + 1 : first + 3, j] = size  # now and late
        variance = np.sum(sums * lu_solve(solved.factor, sums, check_finite=False), axis=0)
        return solved.values @ sums, np.sqrt(variance)

    def set_effective_rows(self, residual: np.ndarray) -> None:
        """Reduce the number of rows by the correlation of neighbouring residuals of a recording.

        That of a first-order autoregressive process: (1 - r) / (1 + r) of the rows are independent.
        """
        for c in self._channels:
            r = residual[:, c] - np.nanmean(residual[:, c])
            pairs = r[1:] * r[:-1]
            pairs[self._readings.starts - 1] = 0.0
            correlation = float(np.nansum(pairs)) / max(float(np.nansum(r**2)), 1e-300)
            self.effective[c] = np.clip((1.0 - correlation) / (1.0 + correlation), 0.05, 1.0)

    def _slopes(self, setup: Setup, free: tuple[Free, ...], prior: np.ndarray) -> np.ndarray:
        """Derivatives of the prediction by the free parameters, shape (M, C, k)."""
        here, steps = self._equations(setup).error, 1e-3 * np.diag(prior)
        slopes, first = np.zeros((*here.shape, len(prior))), 0
        for group in free:
            own = range(first, first := first + group.size)
            if group.kind == "shift":
                channels, reading = self._of(group.field), self._readings.wrenches[group.field]
                known, sensor = np.isfinite(reading).all(axis=1), setup.sensors[group.field]
                columns = place_jacobian(sensor, reading[known], here[known, channels])
                slopes[known, channels, own.start : own.stop] = columns
                continue
            for i in own:
                slopes[..., i] = (here - self._error(setup.moved(free, steps[i]))) / steps[i].sum()
        return slopes

    def _error(self, setup: Setup) -> np.ndarray:
        """Readings minus prediction without nuisances, shape (M, C)."""
        n, rows = self._joints, self._measured.shape[1]
        error = np.full((rows, n + 6 * len(self._fields)), np.nan)
        if self._readings.torque is not None:
            predicted = np.einsum("mclp,lp->mc", self._joint_terms(setup), setup.bodies)
            error[:, :n] = in_order(self._readings.torque, setup.torque_order) - setup.gain * predicted
        for field, reading in self._readings.wrenches.items():
            wrench = np.einsum("mckp,kp->mc", self._load_terms(setup, field), setup.carried(field))
            predicted = wrench @ setup.reading_per_wrench(field).T
            error[:, self._of(field)] = reading - predicted - setup.sensors[field].bias
        return error

    def _basis(self, setup: Setup) -> MotionBasis:
        """Terms of the motion as this setup reads it."""
        return self._bases.of(*_motion(setup))

    def _of(self, field: str) -> slice:
        """Channels of a force/torque sensor."""
        first = self._joints + 6 * self._fields.index(field)
        return slice(first, first + 6)

    def _joint_terms(self, setup: Setup) -> np.ndarray:
        """Torques per inertial parameter, shape (M, n, L, 10)."""

        def found() -> np.ndarray:
            gravity = setup.gravity if setup.meaning == "motor" else np.zeros(3)
            inertia = setup.meaning != "external"
            return self._basis(setup).joints.torques(gravity, inertia, setup.torque_delay)

        key = "joint_torque", *_motion(setup), setup.meaning, setup.torque_delay, setup.gravity.tobytes()
        return self._terms.get(key, found)

    def _load_terms(self, setup: Setup, field: str) -> np.ndarray:
        """Wrench on a sensor per inertial parameter of the bodies that it may carry, shape (M, 6, K, 10)."""
        sensor = setup.sensors[field]

        def found() -> np.ndarray:
            return self._basis(setup).loads(sensor.body).at(setup.gravity, sensor.delay)

        return self._terms.get((*_motion(setup), sensor.body, sensor.delay, setup.gravity.tobytes()), found)

    def _drive_terms(self, setup: Setup) -> np.ndarray:
        """What Coulomb friction, the same reversing late, viscous friction and rotors depend on, shape
        (4, M, n)."""

        def found() -> np.ndarray:
            basis, delay = self._basis(setup), setup.torque_delay
            viscous, rotors = basis.joints.viscous(delay), basis.joints.rotors(delay)
            return np.array([*basis.reversals(delay), viscous, rotors])

        return self._terms.get(("drives", *_motion(setup), setup.torque_delay), found)

    def _nuisances(self, setup: Setup) -> tuple[np.ndarray, dict[str, int]]:
        """Derivatives of the prediction by the nuisances in units of their priors, shape (C, M, P), and the
        first column of each sensor's bias."""
        n, rows = self._joints, self._measured.shape[1]
        size = self._inertia_error * inertial_scales(setup.links)
        links, drives = 10 * (len(size) - 1), 5 * n
        own = sum(6 + 10 * setup.sensors[field].tool_alone for field in self._readings.wrenches)
        found = np.zeros((n + 6 * len(self._fields), rows, links + drives + own))
        # The base does not move, so that its inertia is a bias.
        joints = (self._joint_terms(setup)[:, :, 1:] * size[1:]).reshape(rows, n, -1)
        found[:n, :, :links] = (joints * setup.gain[:, None]).transpose(1, 0, 2)
        coulomb, late, viscous, rotor = self._drive_terms(setup)
        frictional = 0.0 if setup.meaning == "external" else 1.0
        for j in range(n):
            scale, first = setup.gain[j] * self._drive_prior[j], links + 5 * j
            # A value that does not follow the torque is a constant of any size.
            found[j, :, first] = scale or self._drive_prior[j]
            found[j, :, first + 1] = frictional * scale * coulomb[:, j]
            found[j, :, first + 2] = frictional * scale * late[:, j]
            found[j, :, first + 3] = frictional * scale * viscous[:, j]
            found[j, :, first + 4] = frictional * 0.3 * scale * rotor[:, j]
        first, biases = links + drives, {}
        for field in self._readings.wrenches:
            sensor, rates = setup.sensors[field], setup.reading_per_wrench(field)
            terms, channels = self._load_terms(setup, field), self._of(field)
            if sensor.tool_alone:
                terms = terms[:, :, 0] * (self._inertia_error * inertial_scales(setup.carried(field))[0])
                found[channels, :, first : first + 10] = (rates @ terms).transpose(1, 0, 2)
                first += 10
            else:
                moved = max(sensor.body, 1)
                terms = (terms[:, :, moved - sensor.body :] * size[moved:]).reshape(rows, 6, -1)
                found[channels, :, 10 * (moved - 1) : links] = (rates @ terms).transpose(1, 0, 2)
            found[channels, :, first : first + 6] = (sensor.order * _bias_scale(field))[:, None]
            biases[field] = first
            first += 6
        return found, biases

    def _equations(self, setup: Setup) -> Equations:
        """Those of the latest setup are kept: a fit needs them with and without its slopes."""
        if self._stated is None or self._stated[0] is not setup:
            error, (columns, biases) = self._error(setup), self._nuisances(setup)
            # Where a recording lacks a sensor, its rows are zero: they have no weight.
            y = np.where(self._measured, error[:, self._channels].T, 0.0)
            A = columns[self._channels]
            A[~self._measured] = 0.0
            equations = Equations(error, y, A, A.transpose(0, 2, 1) @ A, products(A, y), biases)
            self._stated = setup, equations
        return self._stated[1]

    def _solve(self, setup: Setup, slopes: np.ndarray, prior: np.ndarray) -> Solution:
        """Nuisances, and the free parameters if `slopes` has any, by iteratively weighted least squares."""
        error, y, A, G, b, firsts = self._equations(setup)
        k = slopes.shape[-1] if slopes.size else 0
        if k:
            S = np.ascontiguousarray((slopes * prior)[:, self._channels].transpose(1, 0, 2))
            S[~self._measured] = 0.0
            A, G, b = bordered(S, y, A, G, b)
        floor, rows = self._floor[self._channels], self._counts
        weight = self.effective[self._channels]
        biases = np.array([k + first + i for first in firsts.values() for i in range(6)], dtype=np.int64)
        mean = (y.sum(axis=1) / rows)[:, None]
        variance = np.maximum(np.sum((y - mean) ** 2, axis=1, where=self._measured) / rows, floor)
        values, precision = np.zeros(A.shape[2]), np.ones(A.shape[2])
        diagonal, residual = np.diag_indices(len(values)), y
        for _ in range(_WEIGHTINGS):
            precision[biases] = 2.0 / (1.0 + values[biases] ** 2)
            H = ((weight / variance) @ G.reshape(len(G), -1)).reshape(G.shape[1:])
            H[diagonal] += precision
            # In wrong units, rows weigh up to 1e14 times the prior: a Cholesky decomposition might fail.
            factor = lu_factor(H, check_finite=False)
            values = lu_solve(factor, (weight / variance) @ b, check_finite=False)
            residual = y - (A.reshape(-1, len(values)) @ values).reshape(y.shape)
            variance = np.maximum(np.sum(residual**2, axis=1) / rows, floor)
        full = np.full(error.shape, np.nan)
        full[:, self._channels] = np.where(self._measured, residual, np.nan).T
        gaussian = np.delete(values, biases)[k:]
        penalty = float(gaussian @ gaussian + 2.0 * np.log1p(values[biases] ** 2).sum())
        cost = float(rows * weight @ np.log(variance)) + penalty
        scaled = values.copy()
        scaled[:k] *= prior[:k]
        firsts = {field: k + first for field, first in firsts.items()}
        return Solution(cost, penalty, variance, scaled, factor, full, firsts)

    def _result(
        self,
        setup: Setup,
        free: tuple[Free, ...],
        prior: np.ndarray,
        solved: Solution,
        at: Solution | None = None,
    ) -> Fit:
        at = at or solved
        spread = solved.spread
        bias = {}
        for field, first in solved.biases.items():
            order = setup.sensors[field].order * _bias_scale(field)
            value, own = at.values[at.biases[field] :][:6], spread[first : first + 6]
            bias[field] = order @ value, np.abs(order) @ own
        std = spread[: len(prior)] * prior
        return Fit(setup, free, at.variance, at.penalty, std, at.residual, bias)


def _motion(setup: Setup) -> tuple[str, float, Order, tuple[float, ...]]:
    """What of a setup decides how the motion is understood."""
    return setup.robot, setup.angle_unit, setup.angle_order, setup.angle_zero


def _bias_scale(field: str) -> np.ndarray:
    return _BASE_BIAS if field == BASE else _LINK_BIAS
