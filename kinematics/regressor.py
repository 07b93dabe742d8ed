"""Inertial parameter regressor: momenta and gravity wrenches as linear functions of the inertial parameters.

The momentum of a body and the wrench of gravity on it are linear in its ten inertial parameters `(m, m c_x, m
c_y, m c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz)`: mass, mass times centre of mass, and inertia tensor about
the link frame's origin, in link axes (C. G. Atkeson, C. H. An, J. M. Hollerbach, "Estimation of inertial
parameters of manipulator loads and links", IJRR 1986). So all model terms of the momentum observer
(`contactsense.residuals.momentum_observer`) are linear in them too, and no accelerations are needed.
"""

import numpy as np

from contactsense.kinematics.model import Model, Motion
from contactsense.robots import Inertia
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, add_cross, cross, dot, vector

PARAMETERS = 10
"""Number of inertial parameters of one body."""
WEIGHTS = 4
"""Number of the first of them on which gravity acts: the mass, at the body's origin, and the first moments,
along its axes."""


@kernel
def body_regressor(
    rotation: np.ndarray,
    origin: np.ndarray,
    twist: np.ndarray,
    momentum: np.ndarray,
    angular_velocity: np.ndarray,
) -> None:
    """Momentum of one body per inertial parameter.

    Args:
        rotation, origin: The body's frame in the base frame, (3, 3) and (3,) [m].
        twist: Its velocity at the base origin [m/s] and angular velocity [rad/s], base axes, (6,).
        momentum: Filled, (6, 10): `momentum @ parameters` is its momentum about the base origin, linear part
            first. For a gravity wrench see `weight_regressor`.
        angular_velocity: Scratch, (3,).
    """
    momentum[:, :] = 0.0
    w, o = vector(twist[3:]), vector(origin)
    velocity_of_origin = add_cross(vector(twist), w, o)
    _store(velocity_of_origin, cross(o, velocity_of_origin), momentum[:, 0])
    for i in range(3):
        axis = vector(rotation[:, i])
        p = cross(w, axis)
        _store(p, add_cross(cross(axis, velocity_of_origin), o, p), momentum[:, 1 + i])
        # In body axes.
        angular_velocity[i] = dot(axis, w)
    column = 4
    for k in range(3):
        for i in range(k + 1):
            for r in range(3):
                spin = rotation[r, i] * angular_velocity[k]
                if i != k:
                    spin += rotation[r, k] * angular_velocity[i]
                momentum[3 + r, column] = spin
            column += 1


@kernel
def weight_regressor(
    rotation: np.ndarray, origin: np.ndarray, gravity: np.ndarray, weight: np.ndarray
) -> None:
    """Gravity wrench on one body about the base origin, per inertial parameter.

    Args:
        rotation, origin: The body's frame in the base frame, (3, 3) and (3,) [m].
        gravity: In base axes, (3,) [m/s^2].
        weight: Filled, (6, 10).
    """
    weight[:, :] = 0.0
    g, zero = vector(gravity), (0.0, 0.0, 0.0)
    _store(g, cross(vector(origin), g), weight[:, 0])
    for i in range(WEIGHTS - 1):
        _store(zero, cross(vector(rotation[:, i]), g), weight[:, 1 + i])


@inlined_kernel
def _store(first: Vector, second: Vector, out: np.ndarray) -> None:
    """Store two vectors in an array of six numbers."""
    for i in range(3):
        out[i], out[3 + i] = first[i], second[i]


@kernel
def arm_regressor(
    model: Model,
    motion: Motion,
    gravity: np.ndarray,
    joint_gravity: float,
    joint_inertia: float,
    joint_momentum: np.ndarray,
    joint_drift: np.ndarray,
    base_momentum: np.ndarray,
    base_drift: np.ndarray,
    scratch: np.ndarray,
) -> None:
    """Momenta and drifts of the observer per inertial parameter of every link, after
    `contactsense.kinematics.momenta.kinematics_and_momenta`.

    Args:
        model, motion: The arm, with its poses, screws and twists.
        gravity: In base axes, (3,) [m/s^2].
        joint_gravity, joint_inertia: Factors on gravity and on momenta in the joints' equations: 0 for a
            torque signal that does not contain them.
        joint_momentum: Filled, (n, n + 1, 10): generalized momentum p_j = s_j . H_j, without rotors.
        joint_drift: Filled, (n, n + 1, 10): (ds_j/dt) . H_j + s_j . G_j.
        base_momentum: Filled, (6, n + 1, 10): H_0.
        base_drift: Filled, (6, n + 1, 10): G_0.
        scratch: (3,).
    """
    links = model.mass.shape[0]
    joints = links - 1
    joint_momentum[:, :, :] = 0.0
    joint_drift[:, :, :] = 0.0
    for k in range(links):
        H, G = base_momentum[:, k], base_drift[:, k]
        body_regressor(motion.rotation[k], motion.origin[k], motion.twist[k], H, scratch)
        weight_regressor(motion.rotation[k], motion.origin[k], gravity, G)
        for j in range(min(k, joints)):
            for c in range(10):
                momentum = 0.0
                drift = 0.0
                for i in range(6):
                    momentum += motion.screw[j, i] * H[i, c]
                    drift += joint_inertia * motion.screw_rate[j, i] * H[i, c]
                    drift += joint_gravity * motion.screw[j, i] * G[i, c]
                joint_momentum[j, k, c] = joint_inertia * momentum
                joint_drift[j, k, c] = drift


def parameters_of(inertia: Inertia) -> np.ndarray:
    """The ten inertial parameters of a body, shape (10,)."""
    m, c = inertia.mass, inertia.com
    about_origin = inertia.tensor + m * ((c @ c) * np.eye(3) - np.outer(c, c))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = about_origin
    return np.array([m, *(m * c), xx, xy, yy, xz, yz, zz])


def bodies_of(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses, centres of mass and inertia tensors about them, for inertial parameters of shape (k, 10).

    Returns:
        Shapes (k,), (k, 3), (k, 3, 3). Physically inconsistent parameters are converted as they are.
    """
    m = parameters[:, 0].copy()
    safe = np.where(np.abs(m) > 1e-9, m, 1.0)[:, None]
    c = np.where(np.abs(m[:, None]) > 1e-9, parameters[:, 1:4] / safe, 0.0)
    xx, xy, yy, xz, yz, zz = parameters[:, 4:].T
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    square = np.einsum("ki,ki->k", c, c)[:, None, None] * np.eye(3) - c[:, :, None] * c[:, None, :]
    return m, c, about_origin - m[:, None, None] * square
