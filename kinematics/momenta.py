"""Twists, momenta and gravity wrenches of all links: one outward pass and one suffix sum.

All quantities are in base axes, moments and angular momenta about the base origin. A wrench is (force,
moment). The kernels fill arrays of the caller and allocate nothing. They do not check shapes; callers do.
"""

import numpy as np

from contactsense.kinematics.body_motion import (
    apply_inertia,
    momentum_of_body,
    point_in_base,
    rows_of,
    screw_rate,
    weight_of_body,
)
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, Motion
from contactsense.kinematics.spatial import Six
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import add_cross, cross, scale, vector


@kernel
def kinematics_and_momenta(
    model: Model, q: np.ndarray, qd: np.ndarray, gravity: np.ndarray, motion: Motion
) -> None:
    """Fill all of `motion` for joint positions q [rad], velocities qd [rad/s] and gravity in base axes
    [m/s^2]."""
    forward_kinematics(model, q, motion)
    n = q.shape[0]
    twist, screw, rate = motion.twist, motion.screw, motion.screw_rate
    for i in range(6):
        twist[0, i] = 0.0
    for j in range(n):
        # The screw moves with the parent's twist.
        m, z = screw_rate(vector(twist[j]), vector(twist[j, 3:]), vector(screw[j]), vector(screw[j, 3:]))
        for i in range(3):
            rate[j, i], rate[j, 3 + i] = m[i], z[i]
        for i in range(6):
            twist[j + 1, i] = twist[j, i] + screw[j, i] * qd[j]
    _sum_inward(model, gravity, motion)


@inlined_kernel
def _sum_inward(model: Model, gravity: np.ndarray, motion: Motion) -> None:
    """Suffix sums of momentum and gravity wrench, from the last link to the base."""
    momentum, weight = motion.momentum, motion.gravity
    last = momentum.shape[0] - 1
    for j in range(last, -1, -1):
        body_momentum_and_weight(
            model.mass[j],
            model.com[j],
            model.inertia[j],
            motion.rotation[j],
            motion.origin[j],
            motion.twist[j],
            gravity,
            momentum[j],
            weight[j],
        )
        if j < last:
            for i in range(6):
                momentum[j, i] += momentum[j + 1, i]
                weight[j, i] += weight[j + 1, i]


@inlined_kernel
def body_momentum_and_weight(
    mass: float,
    com: np.ndarray,
    inertia: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
    twist: np.ndarray,
    gravity: np.ndarray,
    momentum: np.ndarray,
    weight: np.ndarray,
) -> None:
    """Momentum and gravity wrench of one body, about the base origin.

    Args:
        mass, com, inertia: Of the body, in a frame fixed to it: [kg], [m] (3,), about its com [kg m^2] (3,
            3).
        rotation, origin: That frame in the base frame, (3, 3) and (3,) [m].
        twist: Velocity of the body at the base origin [m/s] and angular velocity [rad/s], base axes, (6,).
        gravity: In base axes (3,) [m/s^2].
        momentum: Filled: linear and angular momentum (6,).
        weight: Filled: gravity wrench (6,).
    """
    R, angular = rows_of(rotation), vector(twist[3:])
    c = point_in_base(R, vector(origin), vector(com))
    spin = apply_inertia(R, rows_of(inertia), angular)
    h, k = momentum_of_body(mass, c, spin, vector(twist), angular)
    f, m = weight_of_body(mass, c, vector(gravity))
    for i in range(3):
        momentum[i], momentum[3 + i], weight[i], weight[3 + i] = h[i], k[i], f[i], m[i]


@kernel
def of_link_alone(total: np.ndarray, k: int) -> Six:
    """Momentum or gravity wrench of link k alone; `total`: of each link together with all distal ones, shape
    (n + 1, 6), as in `Motion`."""
    a = total[k]
    if k + 1 == total.shape[0]:
        return a[0], a[1], a[2], a[3], a[4], a[5]
    b = total[k + 1]
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5]


@kernel
def per_shift_of_point_mass(
    mass: float, place: np.ndarray, motion: Motion, gravity: np.ndarray, i: int
) -> tuple[Six, Six]:
    """How momentum and gravity wrench of a point mass on the last link change with a coordinate of its place,
    per m.

    Args:
        mass: The mass [kg].
        place: Its place in the link's frame, shape (3,) [m].
        motion: Of the arm, after `kinematics_and_momenta`.
        gravity: In base axes, shape (3,) [m/s^2].
        i: The coordinate.
    """
    last = motion.origin.shape[0] - 1
    R, angular = motion.rotation[last], vector(motion.twist[last, 3:])
    shift = (R[0, i], R[1, i], R[2, i])
    c = point_in_base(rows_of(R), vector(motion.origin[last]), vector(place))
    v = add_cross(vector(motion.twist[last]), angular, c)
    p, m = scale(mass, cross(angular, shift)), scale(mass, cross(shift, vector(gravity)))
    L = add_cross(scale(mass, cross(shift, v)), c, p)
    return (p[0], p[1], p[2], L[0], L[1], L[2]), (0.0, 0.0, 0.0, m[0], m[1], m[2])
