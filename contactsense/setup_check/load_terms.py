"""The wrench of what a force/torque sensor carries, per inertial parameter of each body that it carries.

In the frame of the link in which the sensor rests, the momenta p and L of a body about its origin obey

    dp/dt = m g - w x p - f,    dL/dt = m c x g - w x L - v x p - m_s,

with the link's own velocities v and w, and the wrench (f, m_s) of the body on the sensor. The momentum
observer low-passes that wrench without accelerations, as it does the readings. The base does not move.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.recording_residuals import JointMotion, time_step
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, WEIGHTS, body_regressor
from contactsense.residuals.momentum_observer import advance_all, start_step
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel
from contactsense.setup_check.instants import BANDWIDTH, Instants, at_delay
from contactsense.setup_check.observed_motion import Equations, Kept, at_nodes, node_times

_PER_BODY = 6 * PARAMETERS + 3 * 3 * WEIGHTS
"""Equations of one body."""


@dataclass(frozen=True)
class LoadTerms:
    """Terms at M instants of K bodies, those of a link and of all beyond it, in that link's axes about its
    origin; the tool is a part of the last link."""

    bodies: int
    """K."""
    values: np.ndarray
    """The observer's residuals for each of E equations (see `_fill`), at the five nodes about each
    instant, shape (M, 5, E): the wrench on the sensor with the opposite sign."""
    nodes: np.ndarray
    """Times of the nodes after the instants [s], shape (M, 5)."""

    @classmethod
    def of(cls, model: Model, body: int, recordings: list[FreeMotion], instants: list[Instants]) -> Self:
        """Terms of the motion of recordings without gaps.

        Args:
            model: Kinematics of the arm.
            body: Index of the link, the base being 0.
            recordings: Their motion is used, their readings are not.
            instants: Of each recording.
        """
        bodies = model.joints + 1 - body
        relative = _RelativeMotion(np.empty((3, 3)), np.empty(3), np.empty(6))

        def observe(joints: JointMotion, equations: Equations, kept: Kept) -> None:
            _observe(model, body, joints, BANDWIDTH, relative, equations, kept)

        values = at_nodes(model.joints, bodies * _PER_BODY + 9, recordings, instants, observe)
        return cls(bodies, values, node_times(recordings, instants))

    def at(self, gravity: np.ndarray, delay: float) -> np.ndarray:
        """Wrench per inertial parameter `delay` [s] before each instant, shape (M, 6, K, 10), under `gravity`
        (3,) in base axes [m/s^2]."""
        rows, own = len(self.values), self.bodies * _PER_BODY
        values = -at_delay(self.values, self.nodes, delay)
        by_body = values[:, :own].reshape(rows, self.bodies, _PER_BODY)
        momenta = by_body[..., : 6 * PARAMETERS].reshape(rows, self.bodies, 6, PARAMETERS)
        found = np.ascontiguousarray(momenta.transpose(0, 2, 1, 3))
        moments = by_body[..., 6 * PARAMETERS :].reshape(rows, self.bodies, WEIGHTS, 3, 3) @ gravity
        found[:, 3:, :, :WEIGHTS] += moments.transpose(0, 3, 1, 2)
        # The force is that of the mass alone, whatever the body.
        found[:, :3, :, 0] += (values[:, own:].reshape(rows, 3, 3) @ gravity)[:, :, None]
        return found


class _RelativeMotion(NamedTuple):
    """Motion of a body as the kernel needs it, in axes of the link in which the sensor rests, about its
    origin. Scratch."""

    rotation: np.ndarray
    """From the body's axes, (3, 3)."""
    origin: np.ndarray
    """Of the body, (3,) [m]."""
    twist: np.ndarray
    """Velocity at the link's origin [m/s] and angular velocity [rad/s], both relative to the base, (6,)."""


@kernel
def _observe(
    model: Model,
    body: int,
    joints: JointMotion,
    bandwidth: float,
    relative: _RelativeMotion,
    equations: Equations,
    kept: Kept,
) -> None:
    row = 0
    for i in range(joints.t.shape[0]):
        step = start_step(equations.observer, time_step(joints.t, i), bandwidth)
        kinematics_and_momenta(model, joints.q[i], joints.qd[i], equations.weightless, equations.motion)
        _fill(equations, body, relative)
        advance_all(equations.observer, equations.momentum, equations.drift, step)
        if i >= kept.start and (i - kept.start) % kept.stride == 0:
            copy(equations.observer.residual, kept.residual[row])
            row += 1


@kernel
def _fill(equations: Equations, body: int, relative: _RelativeMotion) -> None:
    """Momentum and drift of each equation at one sample, shape (E,), in this order:

    - of each body: momentum by component and inertial parameter, then the moment of the weight by parameter,
      component and direction of gravity;
    - the force of a mass of one, by component and direction of gravity.
    """
    motion, H, momentum, drift = equations.motion, equations.regressor, equations.momentum, equations.drift
    base, R, o, twist = motion.rotation[body], relative.rotation, relative.origin, relative.twist
    e = 0
    for k in range(body, motion.rotation.shape[0]):
        _place(motion, body, k, relative)
        body_regressor(R, o, twist, H, equations.scratch)
        if k == body:
            vx, vy, vz = twist[0], twist[1], twist[2]
            wx, wy, wz = twist[3], twist[4], twist[5]
        for c in range(PARAMETERS):
            px, py, pz, Lx, Ly, Lz = H[0, c], H[1, c], H[2, c], H[3, c], H[4, c], H[5, c]
            for r in range(6):
                momentum[e + r * PARAMETERS + c] = H[r, c]
            drift[e + c] = wz * py - wy * pz
            drift[e + PARAMETERS + c] = wx * pz - wz * px
            drift[e + 2 * PARAMETERS + c] = wy * px - wx * py
            drift[e + 3 * PARAMETERS + c] = wz * Ly - wy * Lz + vz * py - vy * pz
            drift[e + 4 * PARAMETERS + c] = wx * Lz - wz * Lx + vx * pz - vz * px
            drift[e + 5 * PARAMETERS + c] = wy * Lx - wx * Ly + vy * px - vx * py
        e += 6 * PARAMETERS
        for i in range(WEIGHTS):
            if i == 0:
                ax, ay, az = o[0], o[1], o[2]
            else:
                ax, ay, az = R[0, i - 1], R[1, i - 1], R[2, i - 1]
            for axis in range(3):
                gx, gy, gz = base[axis, 0], base[axis, 1], base[axis, 2]
                drift[e + axis] = ay * gz - az * gy
                drift[e + 3 + axis] = az * gx - ax * gz
                drift[e + 6 + axis] = ax * gy - ay * gx
            e += 9
    for r in range(3):
        for axis in range(3):
            drift[e + 3 * r + axis] = base[axis, r]


@kernel
def _place(motion: Motion, body: int, k: int, relative: _RelativeMotion) -> None:
    """Fill `relative` with the motion of link k."""
    base, origin = motion.rotation[body], motion.origin[body]
    turned, twist = motion.rotation[k], motion.twist[k]
    ox, oy, oz = origin[0], origin[1], origin[2]
    wx, wy, wz = twist[3], twist[4], twist[5]
    vx, vy, vz = twist[0] + wy * oz - wz * oy, twist[1] + wz * ox - wx * oz, twist[2] + wx * oy - wy * ox
    dx, dy, dz = motion.origin[k, 0] - ox, motion.origin[k, 1] - oy, motion.origin[k, 2] - oz
    for r in range(3):
        ex, ey, ez = base[0, r], base[1, r], base[2, r]
        relative.origin[r] = ex * dx + ey * dy + ez * dz
        relative.twist[r] = ex * vx + ey * vy + ez * vz
        relative.twist[3 + r] = ex * wx + ey * wy + ez * wz
        for c in range(3):
            relative.rotation[r, c] = ex * turned[0, c] + ey * turned[1, c] + ez * turned[2, c]
