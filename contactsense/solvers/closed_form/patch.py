"""Patches of a rounded body: a polyhedron, the core, plus a ball."""

from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled
from contactsense.solvers.solution import FAR, Answer, make_answer, torsion
from contactsense.solvers.wrench import Wrench


class Patch(NamedTuple):
    """A contact on the complete surface that a patch is a part of."""

    outside: float
    """How far outside of the patch (below zero: inside)."""
    core: Vector
    """Point of the core."""
    normal: Vector
    """Outward normal."""
    curved: int
    """How many of the principal curvatures are one over the ball's radius: 0 on a face, 1 on an edge, 2 on a
    corner."""


@kernel
def no_patch(curved: int) -> Patch:
    """A contact that is farther away than any."""
    return Patch(FAR, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), curved)


@kernel
def nearer(one: Patch, other: Patch) -> Patch:
    """The contact that is less far outside of its patch, the first one if they are equal."""
    return other if other.outside < one.outside else one


@kernel
def on_patch(status: int, wrench: Wrench, patch: Patch, r: float) -> Answer:
    """The answer for a contact on a patch of a body that is rounded by a ball of radius r."""
    c = add_scaled(patch.core, r, patch.normal)
    bend = 1.0 / r if patch.curved > 0 else 0.0
    det = bend * bend if patch.curved == 2 else 0.0
    return make_answer(
        status, wrench, c, patch.normal, torsion(wrench, c, patch.normal), patch.curved * bend, det
    )
