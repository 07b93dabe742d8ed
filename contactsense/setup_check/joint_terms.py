"""What the momentum observer finds of a motion, per quantity on which the joint torques depend linearly.

A link's momentum is linear in its ten inertial parameters, its weight in the first four of them: its mass,
which acts at the origin of the link, and its first moments, which act along the axes of the link. Only the
joints that carry a link have equations for it.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.recording_residuals import JointMotion, time_step
from contactsense.kinematics.model import Model, Motion, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, WEIGHTS, body_regressor
from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    advance_all,
    empty_observer,
    start_step,
)
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel
from contactsense.setup_check.instants import BANDWIDTH, Instants, at_delay

_PER_PAIR = PARAMETERS + 3 * WEIGHTS
"""Equations of a joint and a link beyond it."""


@dataclass(frozen=True)
class JointTerms:
    """Terms at M instants of one or more recordings, for one arm with n joints and L links."""

    joints: int
    """n."""
    values: np.ndarray
    """The observer's residuals for each of E equations (see `_fill_equations`), at the five nodes about each
    instant, shape (M, 5, E)."""
    nodes: np.ndarray
    """Times of the nodes after the instants [s], shape (M, 5)."""

    @classmethod
    def of(
        cls, model: Model, velocity: float, recordings: list[FreeMotion], instants: list[Instants]
    ) -> Self:
        """Terms of the motion of recordings without gaps.

        Args:
            model: Kinematics of the arm.
            velocity: Width of Coulomb friction's smooth sign [rad/s].
            recordings: Their motion is used, their readings are not.
            instants: Of each recording.
        """
        pairs = list(zip(recordings, instants, strict=True))
        return cls(
            model.joints,
            np.concatenate([_observed(model, velocity, part, at)[at.nodes] for part, at in pairs]),
            np.concatenate([at.node_times(part.t) for part, at in pairs]),
        )

    def torques(self, gravity: np.ndarray, with_inertia: bool, delay: float) -> np.ndarray:
        """Joint torques per inertial parameter of each link, shape (M, n, L, 10).

        Args:
            gravity: In base axes, shape (3,) [m/s^2].
            with_inertia: Whether they contain those of the motion.
            delay: Time before each instant [s].
        """
        n, rows = self.joints, len(self.values)
        link, joint = np.tril_indices(n)
        values = self._at(delay, slice(len(joint) * _PER_PAIR)).reshape(rows, len(joint), _PER_PAIR)
        found = np.zeros((rows, n, n + 1, PARAMETERS))
        if with_inertia:
            found[:, joint, link + 1] = values[..., :PARAMETERS]
        by_axis = values[..., PARAMETERS:].reshape(rows, len(joint), WEIGHTS, 3)
        found[:, joint, link + 1, :WEIGHTS] += by_axis @ gravity
        return found

    def rotors(self, delay: float) -> np.ndarray:
        """Joint accelerations [rad/s^2], shape (M, n), `delay` [s] before each instant."""
        return self._at(delay, slice(-3 * self.joints, -2 * self.joints))

    def coulomb(self, delay: float) -> np.ndarray:
        """Smooth signs of the joint velocities, shape (M, n), `delay` [s] before each instant."""
        return self._at(delay, slice(-2 * self.joints, -self.joints))

    def viscous(self, delay: float) -> np.ndarray:
        """Joint velocities [rad/s], shape (M, n), `delay` [s] before each instant."""
        return self._at(delay, slice(-self.joints, None))

    def _at(self, delay: float, equations: slice) -> np.ndarray:
        return at_delay(self.values[:, :, equations], self.nodes, delay)


def _observed(model: Model, velocity: float, part: FreeMotion, at: Instants) -> np.ndarray:
    """The observer's residuals at all nodes of one recording, shape (N, E)."""
    n, t = model.joints, part.t[at.motion]
    equations = n * (n + 1) // 2 * _PER_PAIR + 3 * n
    start, _, stride = at.keep.indices(len(t))
    out = np.empty((len(range(start, len(t), stride)), equations))
    _observe(
        model, JointMotion(t, part.q[at.motion], part.qd[at.motion]), velocity, BANDWIDTH, np.zeros(3),
        empty_motion(n), empty_observer(equations), np.empty((6, PARAMETERS)), np.empty(3),
        np.zeros(equations), np.zeros(equations), start, stride, out,
    )  # fmt: skip
    return out


@kernel
def _observe(
    model: Model,
    joints: JointMotion,
    velocity: float,
    bandwidth: float,
    weightless: np.ndarray,
    motion: Motion,
    state: MomentumObserver,
    H: np.ndarray,
    scratch: np.ndarray,
    momentum: np.ndarray,
    drift: np.ndarray,
    start: int,
    stride: int,
    out: np.ndarray,
) -> None:
    """Fill `out`, shape (N, E), with every `stride`-th sample from `start` on.

    `weightless`: zero, (3,); `momentum`, `drift`: zero, (E,); `motion`, `H`, `scratch`: overwritten.
    """
    row = 0
    for i in range(joints.t.shape[0]):
        step = start_step(state, time_step(joints.t, i), bandwidth)
        kinematics_and_momenta(model, joints.q[i], joints.qd[i], weightless, motion)
        _fill_equations(motion, joints.qd[i], velocity, H, scratch, momentum, drift)
        advance_all(state, momentum, drift, step)
        if i >= start and (i - start) % stride == 0:
            copy(state.residual, out[row])
            row += 1


@kernel
def _fill_equations(
    motion: Motion,
    qd: np.ndarray,
    velocity: float,
    H: np.ndarray,
    scratch: np.ndarray,
    momentum: np.ndarray,
    drift: np.ndarray,
) -> None:
    """Momentum and drift of each equation at one sample, shape (E,), in this order:

    - of each link and joint before it: momentum about the joint by inertial parameter, then the torque of the
      weight by parameter and direction of gravity;
    - of each joint: rotor, Coulomb and viscous friction.
    """
    n = qd.shape[0]
    e = 0
    for k in range(1, n + 1):
        R, o = motion.rotation[k], motion.origin[k]
        body_regressor(R, o, motion.twist[k], H, scratch)
        for j in range(k):
            s, rate = motion.screw[j], motion.screw_rate[j]
            sx, sy, sz, zx, zy, zz = s[0], s[1], s[2], s[3], s[4], s[5]
            for c in range(PARAMETERS):
                momentum[e + c] = zx * H[3, c] + zy * H[4, c] + zz * H[5, c]
                drift[e + c] = rate[3] * H[3, c] + rate[4] * H[4, c] + rate[5] * H[5, c]
            # Second moments have no linear momentum.
            for c in range(WEIGHTS):
                momentum[e + c] += sx * H[0, c] + sy * H[1, c] + sz * H[2, c]
                drift[e + c] += rate[0] * H[0, c] + rate[1] * H[1, c] + rate[2] * H[2, c]
            e += PARAMETERS
            # With the force g at the point p, s . (g, p x g) = (s_linear + z x p) . g.
            drift[e] = sx + zy * o[2] - zz * o[1]
            drift[e + 1] = sy + zz * o[0] - zx * o[2]
            drift[e + 2] = sz + zx * o[1] - zy * o[0]
            for i in range(3):
                drift[e + 3 + 3 * i] = zy * R[2, i] - zz * R[1, i]
                drift[e + 4 + 3 * i] = zz * R[0, i] - zx * R[2, i]
                drift[e + 5 + 3 * i] = zx * R[1, i] - zy * R[0, i]
            e += 3 * WEIGHTS
    for j in range(n):
        momentum[e + j] = qd[j]
        drift[e + n + j] = -math.tanh(qd[j] / velocity)
        drift[e + 2 * n + j] = -qd[j]
