"""Momentum of an arm for a unit velocity of each joint, from composite inertias: one inward pass, as the
composite rigid body algorithm sums them.

All quantities are in base axes, moments and angular momenta about the base origin.
"""

from typing import NamedTuple

import numpy as np

from contactsense.kinematics.body_motion import Rows, matvec, point_in_base, product, rows_of
from contactsense.kinematics.model import Model, Motion
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.robots.vectors import Vector, add, add_cross, cross, dot, scale, vector


class CompositeInertia(NamedTuple):
    """Inertia of several bodies that move as one."""

    mass: float
    """[kg]"""
    first_moment: Vector
    """Mass times centre of mass [kg m]."""
    second_moment: Rows
    """Inertia tensor about the base origin [kg m^2]."""


@inlined_kernel
def _with_body(
    of: CompositeInertia,
    mass: float,
    com: np.ndarray,
    inertia: np.ndarray,
    rotation: np.ndarray,
    origin: np.ndarray,
) -> CompositeInertia:
    """With one more body; arguments as for `contactsense.kinematics.momenta.body_momentum_and_weight`."""
    R = rows_of(rotation)
    c = point_in_base(R, vector(origin), vector(com))
    x, y, z = product(R, rows_of(inertia))
    # About the base origin: R I R^T + m (c . c - c c^T).
    square, J = mass * dot(c, c), of.second_moment
    a, b, d = matvec(R, x), matvec(R, y), matvec(R, z)
    a = (a[0] + square - mass * c[0] * c[0], a[1] - mass * c[0] * c[1], a[2] - mass * c[0] * c[2])
    b = (b[0] - mass * c[1] * c[0], b[1] + square - mass * c[1] * c[1], b[2] - mass * c[1] * c[2])
    d = (d[0] - mass * c[2] * c[0], d[1] - mass * c[2] * c[1], d[2] + square - mass * c[2] * c[2])
    return CompositeInertia(
        of.mass + mass, add(of.first_moment, scale(mass, c)), (add(J[0], a), add(J[1], b), add(J[2], d))
    )


@kernel
def unit_momenta(
    model: Model,
    motion: Motion,
    first_body: int,
    part: tuple[float, np.ndarray, np.ndarray],
    out: np.ndarray,
) -> None:
    """Momentum of the bodies from `first_body` on for a unit velocity of each joint alone.

    Args:
        model, motion: The arm, with its poses and screws.
        first_body: Index of the first body that counts; the base is 0.
        part: Mass [kg], centre of mass [m] and inertia tensor about it [kg m^2] of a part of the body before
            it that counts as well, in that body's frame; mass 0: none.
        out: Filled: linear and angular momentum for each joint, shape (n, 6) [kg m, kg m^2].
    """
    none = (0.0, 0.0, 0.0)
    found = CompositeInertia(0.0, none, (none, none, none))
    for j in range(out.shape[0] - 1, -1, -1):
        body = j + 1
        if body >= first_body:
            found = _with_body(
                found, model.mass[body], model.com[body], model.inertia[body], motion.rotation[body],
                motion.origin[body],
            )  # fmt: skip
        elif body == first_body - 1 and part[0] > 0.0:
            mass, com, inertia = part
            found = _with_body(found, mass, com, inertia, motion.rotation[body], motion.origin[body])
        velocity, axis = vector(motion.screw[j]), vector(motion.screw[j, 3:])
        linear = add_cross(scale(found.mass, velocity), axis, found.first_moment)
        angular = add(cross(found.first_moment, velocity), matvec(found.second_moment, axis))
        for i in range(3):
            out[j, i], out[j, 3 + i] = linear[i], angular[i]


@kernel
def unit_momenta_of_arm(model: Model, motion: Motion, out: np.ndarray) -> None:
    """Momentum of the whole arm for a unit velocity of each joint alone; arguments as for `unit_momenta`."""
    unit_momenta(model, motion, 0, (0.0, model.com[0], model.inertia[0]), out)
