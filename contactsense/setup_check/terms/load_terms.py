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
from contactsense.calibration.residuals.recording_residuals import JointMotion, time_step
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, WEIGHTS, body_regressor
from contactsense.residuals.momentum_observer import advance_all, start_step
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, add_cross, cross, rotate_back, subtract, vector
from contactsense.setup_check.terms.instants import BANDWIDTH, Instants, at_delay
from contactsense.setup_check.terms.observed_motion import Equations, Kept, at_nodes, keep, node_times

_PER_BODY = 6 * PARAMETERS + 3 * 3 * WEIGHTS
"""Equations of one body."""


@dataclass(frozen=True)
class LoadTerms:
    """Terms at M instants of K bodies, those of a link and of all beyond it, in that link's axes about its
    origin; the tool is a part of the last link."""

    bodies: int
    """K."""
    values: np.ndarray
    """The observer's residuals for each of E equations (see `_fill`), averaged at the five nodes about each
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
        momenta = by_body[..., : 6 * PARAMETERS].reshape(rows, self.bodies, PARAMETERS, 6)
        found = np.ascontiguousarray(momenta.transpose(0, 3, 1, 2))
        moments = by_body[..., 6 * PARAMETERS :].reshape(rows, self.bodies, WEIGHTS, 3, 3)
        found[:, 3:, :, :WEIGHTS] += np.einsum("mkpgc,g->mckp", moments, gravity)
        # The force is that of the mass alone, whatever the body.
        found[:, :3, :, 0] += (gravity @ values[:, own:].reshape(rows, 3, 3))[:, :, None]
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
    for i in range(joints.t.shape[0]):
        step = start_step(equations.observer, time_step(joints.t, i), bandwidth)
        kinematics_and_momenta(model, joints.q[i], joints.qd[i], equations.weightless, equations.motion)
        _fill(equations, body, relative)
        advance_all(equations.observer, equations.momentum, equations.drift, step)
        keep(kept, equations.observer.residual, i)


@kernel
def _fill(equations: Equations, body: int, relative: _RelativeMotion) -> None:
    """Momentum and drift of each equation at one sample, shape (E,), in this order:

    - of each body: momentum by inertial parameter and component, then the moment of the weight by parameter,
      direction of gravity and component;
    - the force of a mass of one, by direction of gravity and component.
    """
    motion, H, momentum, drift = equations.motion, equations.regressor, equations.momentum, equations.drift
    base, R, twist = motion.rotation[body], relative.rotation, relative.twist
    e = 0
    for k in range(body, motion.rotation.shape[0]):
        _place(motion, body, k, relative)
        body_regressor(R, relative.origin, twist, H, equations.scratch)
        if k == body:
            v, w = vector(twist), vector(twist[3:])
        for c in range(PARAMETERS):
            p, L = vector(H[:, c]), vector(H[3:, c])
            _store(p, L, momentum[e:])
            _store(cross(p, w), add_cross(cross(L, w), p, v), drift[e:])
            e += 6
        for i in range(WEIGHTS):
            place = vector(relative.origin) if i == 0 else vector(R[:, i - 1])
            for axis in range(3):
                drift[e], drift[e + 1], drift[e + 2] = cross(place, vector(base[axis]))
                e += 3
    for axis in range(3):
        drift[e], drift[e + 1], drift[e + 2] = vector(base[axis])
        e += 3


@inlined_kernel
def _place(motion: Motion, body: int, k: int, relative: _RelativeMotion) -> None:
    """Fill `relative` with the motion of link k."""
    base, origin = motion.rotation[body], vector(motion.origin[body])
    w = vector(motion.twist[k, 3:])
    velocity = add_cross(vector(motion.twist[k]), w, origin)
    place = rotate_back(base, subtract(vector(motion.origin[k]), origin))
    relative.origin[0], relative.origin[1], relative.origin[2] = place
    _store(rotate_back(base, velocity), rotate_back(base, w), relative.twist)
    for i in range(3):
        axis = rotate_back(base, vector(motion.rotation[k, :, i]))
        relative.rotation[0, i], relative.rotation[1, i], relative.rotation[2, i] = axis


@inlined_kernel
def _store(first: Vector, second: Vector, out: np.ndarray) -> None:
    """Fill the first six numbers of an array."""
    for i in range(3):
        out[i], out[3 + i] = first[i], second[i]
