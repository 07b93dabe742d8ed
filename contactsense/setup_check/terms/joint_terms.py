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
from contactsense.calibration.residuals.recording_residuals import JointMotion, time_step
from contactsense.kinematics.model import Model
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, WEIGHTS, body_regressor
from contactsense.residuals.momentum_observer import advance_all, start_step
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, add_cross, cross, dot, vector
from contactsense.setup_check.terms.instants import BANDWIDTH, Instants, at_delay
from contactsense.setup_check.terms.observed_motion import Equations, Kept, at_nodes, keep, node_times

_PER_PAIR = PARAMETERS + 3 * WEIGHTS
"""Equations of a joint and a link beyond it."""


@dataclass(frozen=True)
class JointTerms:
    """Terms at M instants of one or more recordings, for one arm with n joints and L links."""

    joints: int
    """n."""
    values: np.ndarray
    """The observer's residuals for each of E equations (see `_fill`), averaged at the five nodes about each
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
        n = model.joints

        def observe(joints: JointMotion, equations: Equations, kept: Kept) -> None:
            _observe(model, joints, velocity, BANDWIDTH, equations, kept)

        size = n * (n + 1) // 2 * _PER_PAIR + 3 * n
        return cls(n, at_nodes(n, size, recordings, instants, observe), node_times(recordings, instants))

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


@kernel
def _observe(
    model: Model, joints: JointMotion, velocity: float, bandwidth: float, equations: Equations, kept: Kept
) -> None:
    for i in range(joints.t.shape[0]):
        step = start_step(equations.observer, time_step(joints.t, i), bandwidth)
        kinematics_and_momenta(model, joints.q[i], joints.qd[i], equations.weightless, equations.motion)
        _fill(equations, joints.qd[i], velocity)
        advance_all(equations.observer, equations.momentum, equations.drift, step)
        keep(kept, equations.observer.residual, i)


@kernel
def _fill(equations: Equations, qd: np.ndarray, velocity: float) -> None:
    """Momentum and drift of each equation at one sample, shape (E,), in this order:

    - of each link and joint before it: momentum about the joint by inertial parameter, then the torque of the
      weight by parameter and direction of gravity;
    - of each joint: rotor, Coulomb and viscous friction.
    """
    motion, H, momentum, drift = equations.motion, equations.regressor, equations.momentum, equations.drift
    n, e = qd.shape[0], 0
    for k in range(1, n + 1):
        R, o = motion.rotation[k], motion.origin[k]
        body_regressor(R, o, motion.twist[k], H, equations.scratch)
        for j in range(k):
            slide, turn = vector(motion.screw[j]), vector(motion.screw[j, 3:])
            slide_rate, turn_rate = vector(motion.screw_rate[j]), vector(motion.screw_rate[j, 3:])
            for c in range(PARAMETERS):
                L = vector(H[3:, c])
                momentum[e + c], drift[e + c] = dot(turn, L), dot(turn_rate, L)
            # Second moments have no linear momentum.
            for c in range(WEIGHTS):
                p = vector(H[:, c])
                momentum[e + c] += dot(slide, p)
                drift[e + c] += dot(slide_rate, p)
            e += PARAMETERS
            # The force g at the point p has the torque slide . g + turn . (p x g) = (slide + turn x p) . g.
            _store(add_cross(slide, turn, vector(o)), drift[e:])
            for i in range(3):
                _store(cross(turn, vector(R[:, i])), drift[e + 3 + 3 * i :])
            e += 3 * WEIGHTS
    for j in range(n):
        momentum[e + j] = qd[j]
        drift[e + n + j] = -math.tanh(qd[j] / velocity)
        drift[e + 2 * n + j] = -qd[j]


@inlined_kernel
def _store(values: Vector, out: np.ndarray) -> None:
    """Fill the first three numbers of an array."""
    out[0], out[1], out[2] = values
