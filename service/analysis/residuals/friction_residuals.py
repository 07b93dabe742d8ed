"""How friction differs from the scene's, from residuals without contact: Coulomb and viscous part of each
joint.

The residual of a joint's torque after model and friction, low-passed by the observer, is fitted with the
low-passed sign and value of the joint's velocity, and a constant. Outliers have less weight (Huber's
weights): impacts below the threshold, reversals, other model errors.
"""

import math
from dataclasses import dataclass

import numpy as np

from contactsense import BlockEstimates, SampleBlock
from contactsense.calibration.fit.robust_least_squares import MAD_SCALE
from contactsense.robots.jit.kernel import kernel
from contactsense.scene import Scene
from contactsense.sensors.stream_state import (
    INVALID,
    MISSING,
    REPEATED,
    SETTLING,
    TOUCHED,
    UNSETTLED,
    UNUSABLE,
)

ROW_INTERVAL = 0.02
"""Time between two rows of the fit: residuals are low-passed, those in between add little information [s]."""
PAUSE = 5.0
"""Time constants of the observer after a contact, or after a gap, until residuals are used again."""
STEADY = 0.9
"""Size of the low-passed sign above which a joint moves steadily; others rest or reverse."""
LEAST_ROWS = 25
"""Rows in each direction that a fit needs: half a second."""
HUBER, ITERATIONS = 1.345, 20
"""Residuals of the fit beyond this number of standard deviations are outliers: that of 95 % efficiency if the
noise is normal (P. J. Huber, "Robust Statistics", 1981). Steps of the iteration."""
_UNUSED = REPEATED | UNUSABLE | SETTLING | (MISSING | INVALID | UNSETTLED) << 1


@dataclass(frozen=True, eq=False)
class FrictionChange:
    """By how much friction is larger than the scene says, n joints; NaN where a joint did not move enough in
    both directions."""

    coulomb: np.ndarray
    """Coulomb friction [Nm], shape (n,)."""
    viscous: np.ndarray
    """Viscous friction [Nm s/rad], shape (n,)."""
    coulomb_std: np.ndarray
    """Standard deviation by the noise of the residuals, shape (n,)."""
    viscous_std: np.ndarray
    """The same of the viscous part, shape (n,)."""
    bias: np.ndarray
    """Remaining torque, independent of velocity: the bias [Nm], shape (n,)."""

    def __repr__(self) -> str:
        return (
            f"<friction beyond the scene's: Coulomb {np.round(self.coulomb, 3).tolist()} Nm, viscous "
            f"{np.round(self.viscous, 3).tolist()} Nm s/rad>"
        )


class FrictionResiduals:
    """Collects blocks of one recording."""

    def __init__(self, scene: Scene) -> None:
        """Start without any block."""
        joints = len(scene.robot.joints)
        sensor = scene.joint_torque
        self._sign_velocity = 0.01 if sensor is None else sensor.friction.velocity
        self._rate = 2.0 * math.pi * scene.bandwidth
        # Low-passed sign and velocity, those at the last sample, its time, time since a contact, since a row.
        self._state = np.zeros((4, joints))
        self._times = np.array([-math.inf, 0.0, 0.0])
        self._rows: list[np.ndarray] = []

    def add(self, block: SampleBlock, found: BlockEstimates) -> None:
        """Add a block and its estimates."""
        rows = np.empty((len(block), 3, self._state.shape[1]))
        count = _collect(
            block.t, block.qd, found.flags, found.joint_torque,
            found.joint_bias + found.joint_friction, self._rate,
            self._sign_velocity, self._state, self._times, rows,
        )  # fmt: skip
        self._rows.append(rows[:count].copy())

    def fit(self) -> FrictionChange:
        """Difference of friction from the scene's in the blocks so far."""
        rows = np.concatenate(self._rows) if self._rows else np.zeros((0, 3, self._state.shape[1]))
        correlation = math.exp(-self._rate * ROW_INTERVAL)
        inflation = (1.0 + correlation) / (1.0 - correlation)
        joints = [_fit(rows[:, :, j], inflation) for j in range(rows.shape[2])]
        return FrictionChange(*np.array(joints).T)


def _fit(rows: np.ndarray, inflation: float) -> tuple[float, float, float, float, float]:
    """Coulomb and viscous friction of one joint, their standard deviations, and the bias.

    Args:
        rows: Torque, low-passed sign and velocity, shape (N, 3).
        inflation: Factor by which correlation of the rows increases the variance of a mean.
    """
    steady = rows[np.abs(rows[:, 1]) > STEADY]
    forward = int(np.sum(steady[:, 1] > 0.0))
    if min(forward, len(steady) - forward) < LEAST_ROWS:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    torque = steady[:, 0]
    regressors = np.column_stack((steady[:, 1:], np.ones(len(steady))))
    weight = np.ones(len(steady))
    for _ in range(ITERATIONS):
        weighted = regressors * weight[:, None]
        found = np.linalg.lstsq(weighted.T @ regressors, weighted.T @ torque, rcond=None)[0]
        error = torque - regressors @ found
        spread = max(MAD_SCALE * float(np.median(np.abs(error))), 1e-12)
        weight = np.minimum(1.0, HUBER * spread / np.maximum(np.abs(error), 1e-300))
    covariance = spread**2 * inflation * np.linalg.pinv((regressors * weight[:, None]).T @ regressors)
    coulomb_std, viscous_std, _ = np.sqrt(np.diag(covariance))
    return float(found[0]), float(found[1]), float(coulomb_std), float(viscous_std), float(found[2])


@kernel
def _collect(
    t: np.ndarray,
    qd: np.ndarray,
    flags: np.ndarray,
    residual: np.ndarray,
    estimated: np.ndarray,
    rate: float,
    sign_velocity: float,
    state: np.ndarray,
    times: np.ndarray,
    rows: np.ndarray,
) -> int:
    """Rows for the fit.

    Args:
        t, qd: As in `contactsense.SampleBlock`.
        flags, residual: `flags` and `joint_torque` of `contactsense.BlockEstimates`.
        estimated: What its localizer has subtracted already, sum of `joint_bias` and `joint_friction`, shape
            (N, n) [Nm].
        rate: Inverse of the observer's time constant [1/s].
        sign_velocity: Width of Coulomb friction's smooth sign [rad/s].
        state, times: State of `FrictionResiduals`.
        rows: Filled: torque that friction takes beyond the model, low-passed sign and velocity of each joint,
            shape (N, 3, n).

    Returns:
        Number of rows filled.
    """
    n, count = qd.shape[1], 0
    for i in range(t.shape[0]):
        if flags[i] & _UNUSED:
            times[1] = 0.0
            continue
        dt = t[i] - times[0]
        times[0] = t[i]
        if not 0.0 < dt < 1.0:
            dt, times[1] = 0.0, 0.0
        passed = math.exp(-rate * dt) if dt > 0.0 else 0.0
        for j in range(n):
            sign, velocity = math.tanh(qd[i, j] / sign_velocity), qd[i, j]
            mean_sign = 0.5 * (sign + state[2, j]) if dt > 0.0 else sign
            mean_velocity = 0.5 * (velocity + state[3, j]) if dt > 0.0 else velocity
            state[0, j] = mean_sign + passed * (state[0, j] - mean_sign)
            state[1, j] = mean_velocity + passed * (state[1, j] - mean_velocity)
            state[2, j], state[3, j] = sign, velocity
        times[1] = 0.0 if flags[i] & TOUCHED else times[1] + dt
        times[2] += dt
        if times[1] * rate < PAUSE or times[2] < ROW_INTERVAL:
            continue
        times[2] = 0.0
        for j in range(n):
            # The residual is what the surroundings exert: model less measurement.
            rows[count, 0, j] = estimated[i, j] - residual[i, j]
            rows[count, 1, j], rows[count, 2, j] = state[0, j], state[1, j]
        count += 1
    return count
