"""The contact on one link by the paper's closed form: intrinsic contact sensing.

Bicchi, Salisbury & Brock (1993) know the touched body, which is convex. A link is a union of convex
primitives: of the contacts on them that lie outside the other primitives, the one with the least torsion
relative to its normal force is chosen. Without torsion, it is the place where the wrench axis enters the
link.
"""

import math

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import ELLIPSOID, REVOLVED, Surfaces
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, cross, dot, vector
from contactsense.solvers.closed_form.packed_primitive import solve_primitive
from contactsense.solvers.closed_form.wrench_axis import (
    wrench_axis_box,
    wrench_axis_ellipsoid,
    wrench_axis_revolved,
)
from contactsense.solvers.solution import OK, Answer, placed
from contactsense.solvers.wrench import Wrench, in_frame

MAX_DEPTH = 1e-6
"""A contact deeper inside another primitive of its link is rejected [m]."""


@kernel
def contact_on_link(
    surfaces: Surfaces, link: int, wrench: Wrench, with_torsion: bool
) -> tuple[int, Vector, Vector, float]:
    """Contact that balances a wrench on one link.

    Args:
        surfaces: Primitives in the frames of their links.
        link: Index of the link.
        wrench: Wrench on the link, link frame.
        with_torsion: Whether torsion about the normal is possible; without it, the contact is where the
            wrench axis enters.

    Returns:
        Index of the primitive, -1 if no push on the link balances the wrench; point [m] and outward unit
        normal, link frame; torsion [Nm].
    """
    first, last = surfaces.start[link], surfaces.start[link + 1]
    best, least = -1, math.inf
    point, normal, torsion = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    for p in range(first, last):
        answer = _contact_on_primitive(surfaces, p, wrench, with_torsion)
        c = answer.centroid
        push = -dot(wrench.force, answer.normal)
        if answer.status != OK or push <= 0.0:
            continue
        depth = -nearest(surfaces, first, last, c)[0]
        if depth > MAX_DEPTH:
            continue
        # Without torsion the entry farthest back along the force.
        order = abs(answer.torsion) / push if with_torsion else dot(wrench.force, c)
        if order < least:
            best, least = p, order
            point, normal, torsion = c, answer.normal, answer.torsion
    return best, point, normal, torsion


@kernel
def _contact_on_primitive(surfaces: Surfaces, p: int, wrench: Wrench, with_torsion: bool) -> Answer:
    """Contact on one primitive, link frame."""
    R, size, kind = surfaces.rotation[p], surfaces.size[p], surfaces.kind[p]
    origin = vector(surfaces.origin[p])
    local = in_frame(wrench, R, origin)
    if with_torsion:
        answer = solve_primitive(kind, size, local)
    elif kind == REVOLVED:
        answer = wrench_axis_revolved(local, size[0], size[1], size[2], size[3])
    elif kind == ELLIPSOID:
        answer = wrench_axis_ellipsoid(local, size[0], size[1], size[2])
    else:
        answer = wrench_axis_box(local, (size[0], size[1], size[2]), size[3])
    return placed(answer, R, origin)


@kernel
def centroid_covariance(
    point: Vector,
    normal: Vector,
    force: Vector,
    wrench_covariance: np.ndarray,
    surface_deviation: float,
    covariance: np.ndarray,
) -> None:
    """Covariance of a contact centroid from that of the wrench, to first order, without the curvature's part.

    An error of the moment about the centroid, dm - c x df, shifts it in its tangent plane by n x (dm - c x
    df) / (f . n): exact on flat surfaces and without torsion.

    Args:
        point, normal, force: Contact, all in one frame [m, N].
        wrench_covariance: Of force and moment about the frame's origin, shape (6, 6).
        surface_deviation: Standard deviation of the surface's offset along the normal [m].
        covariance: Filled, shape (3, 3) [m^2].
    """
    scale = 1.0 / dot(force, normal)
    for i in range(3):
        for k in range(3):
            covariance[i, k] = normal[i] * normal[k] * surface_deviation**2
    for a in range(6):
        shift_a = _shift(point, normal, a)
        for b in range(6):
            shift_b = _shift(point, normal, b)
            factor = wrench_covariance[a, b] * scale * scale
            for i in range(3):
                for k in range(3):
                    covariance[i, k] += factor * shift_a[i] * shift_b[k]


@kernel
def _shift(point: Vector, normal: Vector, component: int) -> Vector:
    """n x (dm - c x df) for a unit error in one component of the wrench."""
    axis = (
        1.0 if component % 3 == 0 else 0.0,
        1.0 if component % 3 == 1 else 0.0,
        1.0 if component % 3 == 2 else 0.0,
    )
    if component < 3:
        axis = cross(axis, point)
    shift: Vector = cross(normal, axis)
    return shift
