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
from contactsense.robots.jit.kernel import kernel

PARAMETERS = 10
"""Number of inertial parameters of one body."""


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
    wx, wy, wz = twist[3], twist[4], twist[5]
    ox, oy, oz = origin[0], origin[1], origin[2]
    # Velocity of the body's origin.
    vx, vy, vz = twist[0] + wy * oz - wz * oy, twist[1] + wz * ox - wx * oz, twist[2] + wx * oy - wy * ox
    momentum[0, 0], momentum[1, 0], momentum[2, 0] = vx, vy, vz
    momentum[3, 0], momentum[4, 0], momentum[5, 0] = oy * vz - oz * vy, oz * vx - ox * vz, ox * vy - oy * vx
    for i in range(3):
        ex, ey, ez = rotation[0, i], rotation[1, i], rotation[2, i]
        px, py, pz = wy * ez - wz * ey, wz * ex - wx * ez, wx * ey - wy * ex  # omega x e
        momentum[0, 1 + i], momentum[1, 1 + i], momentum[2, 1 + i] = px, py, pz
        momentum[3, 1 + i] = ey * vz - ez * vy + oy * pz - oz * py
        momentum[4, 1 + i] = ez * vx - ex * vz + oz * px - ox * pz
        momentum[5, 1 + i] = ex * vy - ey * vx + ox * py - oy * px
        angular_velocity[i] = ex * wx + ey * wy + ez * wz  # angular velocity in body axes
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
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    weight[0, 0], weight[1, 0], weight[2, 0] = gx, gy, gz
    for i in range(4):
        if i == 0:
            ax, ay, az = origin[0], origin[1], origin[2]
        else:
            ax, ay, az = rotation[0, i - 1], rotation[1, i - 1], rotation[2, i - 1]
        weight[3, i] = ay * gz - az * gy
        weight[4, i] = az * gx - ax * gz
        weight[5, i] = ax * gy - ay * gx


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
