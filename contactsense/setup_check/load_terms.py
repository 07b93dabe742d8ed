"""The wrench of what a force/torque sensor carries, per inertial parameter of each body that it carries.

In the frame of the link in which the sensor rests, the momenta p and L of a body about its origin obey

    dp/dt = m g - w x p - f,    dL/dt = m c x g - w x L - v x p - m_s,

with the link's own velocities v and w, and the wrench (f, m_s) of the body on the sensor. The momentum
observer low-passes that wrench without accelerations, as it does the readings.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.momentum_observer import MomentumObserver, empty_observer, start_step
from contactsense.robots import Robot
from contactsense.robots.jit.kernel import kernel
from contactsense.setup_check.instants import Instants, at_delay


@dataclass(frozen=True)
class LoadTerms:
    """Terms of K bodies, those of a link and of all beyond it, in that link's axes about its origin.

    They are known at five nodes about each of M instants, so that the delay of a sensor can be changed.
    """

    gravity: np.ndarray
    """Wrench of the bodies per gravity component in base axes and inertial parameter, at the nodes about each
    instant, shape (3, M, 5, 6, K, 10)."""
    dynamics: np.ndarray
    """The same for the motion alone, shape (M, 5, 6, K, 10)."""
    nodes: np.ndarray
    """Times of the nodes after the instant [s], shape (M, 5)."""

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """The terms of several recordings."""
        return cls(
            np.concatenate([part.gravity for part in parts], axis=1),
            np.concatenate([part.dynamics for part in parts]),
            np.concatenate([part.nodes for part in parts]),
        )

    def at(self, gravity: np.ndarray, delay: float) -> np.ndarray:
        """Wrench per inertial parameter `delay` [s] before each instant, shape (M, 6, K, 10), under `gravity`
        (3,) in base axes [m/s^2]."""
        axes = [at_delay(axis, self.nodes, delay) for axis in self.gravity]
        return np.asarray(np.tensordot(gravity, axes, 1) + at_delay(self.dynamics, self.nodes, delay))


def load_terms(robot: Robot, part: FreeMotion, at: Instants, body: int, bandwidth: float) -> LoadTerms:
    """Terms of one link and all beyond it, the tool being a part of the last one.

    Args:
        robot: The arm.
        part: Its motion is used, its readings are not. No gaps.
        at: Which samples are used.
        body: Index of the link, the base being 0.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    t = part.t[at.motion]
    motion = _LinkMotion.of(robot, part.q[at.motion], part.qd[at.motion])
    v, w = motion.velocity[:, body], motion.turning[:, body]
    found = []
    for k in range(body, len(robot.links)):
        own = _momenta(motion.velocity[:, k], motion.turning[:, k])
        momentum = motion.moved(own, k, body)
        p, L = momentum[:, :3], momentum[:, 3:]
        rate = np.concatenate((_cross(w, p), _cross(w, L) + _cross(v, p)), axis=1)
        weights = [motion.moved(_weights(motion.rotation[:, k, axis]), k, body) for axis in range(3)]
        still = np.zeros_like(momentum)
        momenta = np.stack((still, still, still, momentum), axis=1)
        drifts = np.stack((*weights, -rate), axis=1)
        found.append(-_low_passed(t, momenta, drifts, bandwidth)[at.keep][at.nodes])
    # Rows, nodes, terms, components, parameters of each body.
    terms = np.stack(found, axis=-2).transpose(2, 0, 1, 3, 4, 5)
    return LoadTerms(terms[:3], terms[3], at.node_times(part.t))


@dataclass(frozen=True)
class _LinkMotion:
    """Motion of L links at N instants, velocities in each link's own axes."""

    rotation: np.ndarray
    """Link axes to base axes, shape (N, L, 3, 3)."""
    origin: np.ndarray
    """In the base frame, shape (N, L, 3) [m]."""
    velocity: np.ndarray
    """Of the link's origin, shape (N, L, 3) [m/s]."""
    turning: np.ndarray
    """Angular velocity, shape (N, L, 3) [rad/s]."""

    @classmethod
    def of(cls, robot: Robot, q: np.ndarray, qd: np.ndarray) -> Self:
        """Motion of an arm with n joints; `q`, `qd`: shape (N, n) [rad, rad/s]."""
        model, motion, gravity = build_model(robot), empty_motion(len(robot.joints)), np.zeros(3)
        shape = (len(q), len(robot.links))
        rotation, origin, twist = np.empty((*shape, 3, 3)), np.empty((*shape, 3)), np.empty((*shape, 6))
        for i, (position, speed) in enumerate(zip(q, qd, strict=True)):
            kinematics_and_momenta(model, position, speed, gravity, motion)
            rotation[i], origin[i], twist[i] = motion.rotation, motion.origin, motion.twist
        at_origin = twist[..., :3] + np.cross(twist[..., 3:], origin)
        own = (np.einsum("nli,nlij->nlj", vector, rotation) for vector in (at_origin, twist[..., 3:]))
        return cls(rotation, origin, *own)

    def moved(self, wrench: np.ndarray, link: int, body: int) -> np.ndarray:
        """Wrenches or momenta, shape (N, 6, k), from the axes and origin of `link` to those of `body`."""
        back = self.rotation[:, body].swapaxes(1, 2)
        turn = back @ self.rotation[:, link]
        place = np.einsum("nij,nj->ni", back, self.origin[:, link] - self.origin[:, body])
        force, moment = turn @ wrench[:, :3], turn @ wrench[:, 3:]
        return np.concatenate((force, moment + _cross(place, force)), axis=1)


def _cross(a: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Cross product of vectors, shape (N, 3), with the columns of matrices, shape (N, 3, k)."""
    return np.asarray(np.cross(a[:, :, None], columns, axis=1))


def _momenta(v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Momenta per inertial parameter, shape (N, 6, 10), for velocities of shape (N, 3), all in body axes."""
    axes = np.broadcast_to(np.eye(3), (len(v), 3, 3))
    momentum = np.zeros((len(v), 6, 10))
    momentum[:, :3, 0] = v
    momentum[:, :3, 1:4] = _cross(w, axes)
    momentum[:, 3:, 1:4] = -_cross(v, axes)
    column = 4
    for k in range(3):
        for i in range(k + 1):
            momentum[:, 3 + i, column] = w[:, k]
            momentum[:, 3 + k, column] = w[:, i]
            column += 1
    return momentum


def _weights(down: np.ndarray) -> np.ndarray:
    """Wrenches of a unit gravity per inertial parameter, shape (N, 6, 10); `down`: its direction in body
    axes, shape (N, 3)."""
    weight = np.zeros((len(down), 6, 10))
    weight[:, :3, 0] = down
    weight[:, 3:, 1:4] = -_cross(down, np.broadcast_to(np.eye(3), (len(down), 3, 3)))
    return weight


def _low_passed(t: np.ndarray, momentum: np.ndarray, drift: np.ndarray, bandwidth: float) -> np.ndarray:
    """Residuals of the momentum observer (`contactsense.residuals.momentum_observer`) at every sample, for
    arrays of equations of shape (N, ...)."""
    residual = np.empty_like(momentum)
    flat = (len(t), -1)
    _observe(
        np.diff(t, prepend=t[0]),
        momentum.reshape(flat),
        drift.reshape(flat),
        residual.reshape(flat),
        bandwidth,
        empty_observer(0),
    )
    return residual


@kernel
def _observe(
    dt: np.ndarray,
    momentum: np.ndarray,
    drift: np.ndarray,
    residual: np.ndarray,
    bandwidth: float,
    steps: MomentumObserver,
) -> None:
    """Fill `residual`, shape (N, k) as `momentum` and `drift`; `dt`: time since the sample before [s], 0 for
    the first, shape (N,)."""
    for i in range(dt.shape[0]):
        a, b0, b1, b2, b3, K = start_step(steps, dt[i], bandwidth)
        weights = (b0, b1, b2, b3)
        for c in range(momentum.shape[1]):
            if i == 0:
                residual[0, c] = 0.0
                continue
            value = a * residual[i - 1, c] + K * (momentum[i, c] - a * momentum[i - 1, c])
            for k in range(min(i + 1, 4)):
                value -= weights[k] * (K * momentum[i - k, c] + drift[i - k, c])
            residual[i, c] = value
