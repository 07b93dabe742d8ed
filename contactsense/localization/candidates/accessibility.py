"""Accessibility: which points of the surface can be touched.

A point cannot if it is inside of its own link, if a body of the cell or another link leaves no room for a
finger above it, or if it is on the mounting face of the base. Its own link need not leave that room: beside a
concave edge, the next face is within it.
"""

import math
from typing import NamedTuple

from contactsense.kinematics.wrench_information import matvec
from contactsense.localization.candidates.candidate_buffers import Candidates
from contactsense.localization.candidates.mixture_reduction import write_moments
from contactsense.localization.candidates.place_covariance import about_another_point
from contactsense.localization.candidates.simd_neighbourhood import (
    QUADRATURE_RINGS,
    accessible_moments,
    cover_points,
    spread_points,
    tail_of_penetration,
)
from contactsense.localization.surface.mean_surface_distance import mean_surface_distance
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, out_of_reach, project
from contactsense.robots.vectors import (
    Vector,
    add,
    add_scaled,
    dot,
    rotate,
    rotate_back,
    scale,
    subtract,
    tangents,
    vector,
)
from contactsense.solvers.posterior.contact_prior import Prior

CURVATURE_MARGIN = 1.1
"""Factor on the radius of a ring within which no other primitive may lie; allows for curvature."""
CLEARANCE_SIGMAS = CURVATURE_MARGIN * QUADRATURE_RINGS[2][0]
"""A place is fully accessible if its clearance exceeds this many standard deviations: beyond the widest ring
nothing counts."""
FULL_CLEARANCE_SIGMAS = CURVATURE_MARGIN * QUADRATURE_RINGS[1][0]
"""A candidate is not changed if its clearance exceeds this many standard deviations: beyond the second ring
lies one percent of the weight."""
OWN_CLEARANCE = 0.5e-3
"""Height above a point that all other primitives of the same link must leave free [m]: more than none, as
the faces on which two primitives touch are inside of the link."""
PENETRATION_SCALE = 4.0
"""Scale of the tolerated penetration: the surface deviation over this number."""
MOUNTING_FACE_NORMAL = -0.5
"""The normal of the mounting face has a smaller z component than this: it points down by more than 30
degrees."""
FULLY_ACCESSIBLE = 0.98
"""Accessible share above which point and covariance of a candidate are not changed."""


class _Coverings(NamedTuple):
    """Indices of the primitives that may cover points of one link: `first` to `last` - 1, those of the link
    and of its neighbours; and from `bodies` on, those of the cell's bodies."""

    first: int
    last: int
    bodies: int
    size: int
    """How many these are."""


@inlined_fused_kernel
def _coverings(surfaces: Surfaces, link: int) -> _Coverings:
    """The primitives that may cover points of a link."""
    links = surfaces.start.shape[0] - 1
    first, last = surfaces.start[max(link - 1, 0)], surfaces.start[min(link + 2, links)]
    bodies = surfaces.start[links]
    return _Coverings(first, last, bodies, last - first + surfaces.kind.shape[0] - bodies)


@inlined_fused_kernel
def _covering(coverings: _Coverings, k: int) -> int:
    """The k-th of them."""
    own = coverings.last - coverings.first
    return coverings.first + k if k < own else coverings.bodies + k - own


@inlined_fused_kernel
def _free_height(surfaces: Surfaces, p: int, link: int, height: float) -> float:
    """Height that primitive p must leave free above the points of a link [m]: `height` if it is not one of
    the link's own."""
    return OWN_CLEARANCE if surfaces.start[link] <= p < surfaces.start[link + 1] else height


@inlined_fused_kernel
def _clearance_from(
    surface: PlacedSurface, p: int, height: float, c: Vector, n: Vector, reach: float
) -> float:
    """Distance from the mean surface of primitive p of the place `height` above a point c with the normal n,
    base frame [m]; at most `reach`."""
    surfaces, deviations, frames = surface
    o, own_reach = frames.origin[p], reach + deviations.displacement[p]
    dx, dy, dz = c[0] + height * n[0] - o[0], c[1] + height * n[1] - o[1], c[2] + height * n[2] - o[2]
    distance, radius = reach, surfaces.radius[p] + own_reach
    if radius > 0.0 and dx * dx + dy * dy + dz * dz <= radius * radius:
        R = frames.rotation[p]
        place = (
            R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
            R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
            R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
        )
        if not out_of_reach(surfaces.kind[p], surfaces.size[p], place[0], place[1], place[2], own_reach):
            distance = min(distance, mean_surface_distance(surfaces, deviations, p, place))
    return distance


@inlined_fused_kernel
def clearance(
    surface: PlacedSurface, excluded: int, c: Vector, n: Vector, height: float, max_distance: float
) -> float:
    """Clearance of a point: distance of the place above it from the mean surface of the nearest other
    primitive of its link or of a neighbouring one, or of a body of the cell that covers [m].

    Args:
        surface: Where all primitives are; those beyond the last link's are of bodies that cover.
        excluded: Primitive that is ignored: the one on which the point lies.
        c, n: The point [m] and the outward normal there, base frame.
        height: Height of the place above it, `OWN_CLEARANCE` for primitives of its own link [m].
        max_distance: Upper bound of the result [m].

    Returns:
        The clearance, negative inside, at most `max_distance`.
    """
    surfaces, distance = surface.surfaces, max_distance
    link = surfaces.link[excluded]
    coverings = _coverings(surfaces, link)
    for k in range(coverings.size):
        p = _covering(coverings, k)
        if p != excluded:
            above = _free_height(surfaces, p, link, height)
            distance = _clearance_from(surface, p, above, c, n, distance)
    return distance


@fused_kernel
def accessible_share(margin: float, prior: Prior) -> float:
    """Probability that a place can be touched, given the clearance `margin` above it [m].

    1 for a positive clearance; for a negative one see
    `contactsense.localization.candidates.simd_neighbourhood.tail_of_penetration`.
    """
    if margin >= 0.0:
        return 1.0
    share: float = tail_of_penetration(margin, prior.surface_deviation / PENETRATION_SCALE)
    return share


@fused_kernel
def candidate_clearance(
    surface: PlacedSurface, candidates: Candidates, row: int, prior: Prior
) -> tuple[float, float, float, float, float, int]:
    """`clearance` of a candidate's point, with the height `prior.clearance`.

    The other primitives that are nearer than the neighbourhood is wide are written to `near`: no others can
    cover any of it.

    Returns:
        Clearance [m], at most `CLEARANCE_SIGMAS` times the largest standard deviation of the point; that
        standard deviation [m]; the point's covariance along `tangents` (v11, v12, v22) [m^2]; and the number
        of primitives in `near`.
    """
    c, n = candidates.point[row], candidates.normal[row]
    C = candidates.covariance[row]
    (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents((n[0], n[1], n[2]))
    c1x = C[0, 0] * t1x + C[0, 1] * t1y + C[0, 2] * t1z
    c1y = C[1, 0] * t1x + C[1, 1] * t1y + C[1, 2] * t1z
    c1z = C[2, 0] * t1x + C[2, 1] * t1y + C[2, 2] * t1z
    v11 = t1x * c1x + t1y * c1y + t1z * c1z
    v12 = t2x * c1x + t2y * c1y + t2z * c1z
    v22 = (
        t2x * (C[0, 0] * t2x + C[0, 1] * t2y + C[0, 2] * t2z)
        + t2y * (C[1, 0] * t2x + C[1, 1] * t2y + C[1, 2] * t2z)
        + t2z * (C[2, 0] * t2x + C[2, 1] * t2y + C[2, 2] * t2z)
    )
    max_deviation = math.sqrt(max(0.5 * (v11 + v22) + math.sqrt(0.25 * (v11 - v22) ** 2 + v12 * v12), 0.0))
    reach = CLEARANCE_SIGMAS * max_deviation
    distance, near = reach, 0
    place, normal, surfaces = vector(c), vector(n), surface.surfaces
    link = surfaces.link[candidates.primitive[row]]
    coverings = _coverings(surfaces, link)
    for k in range(coverings.size):
        p = _covering(coverings, k)
        if p == candidates.primitive[row]:
            continue
        above = _free_height(surfaces, p, link, prior.clearance)
        free = _clearance_from(surface, p, above, place, normal, reach)
        if free < reach:
            candidates.near[near] = p
            distance = min(distance, free)
            near += 1
    return distance, max_deviation, v11, v12, v22, near


@fused_kernel
def apply_accessibility(
    surface: PlacedSurface, candidates: Candidates, row: int, frame: Frame, prior: Prior, min_score: float
) -> None:
    """Condition a candidate on being accessible.

    The candidate's score is lowered by the log of the accessible share of its neighbourhood. Its point
    becomes the mean of that share, unless the force would pull there; its covariance along the surface, the
    second moments about the point. If the score cannot exceed `min_score`, it becomes -infinity at once.
    `frame`: body frame of the candidate's primitive, see
    `contactsense.localization.candidates.candidate_buffers.store_candidate`.
    """
    distance, max_deviation, v11, v12, v22, near = candidate_clearance(surface, candidates, row, prior)
    if distance >= FULL_CLEARANCE_SIGMAS * max_deviation:
        return
    if (
        candidates.score[row] + math.log(accessible_share(distance + CLEARANCE_SIGMAS * max_deviation, prior))
        < min_score
    ):
        candidates.score[row] = -math.inf
        return
    surfaces, p = surface.surfaces, candidates.primitive[row]
    c, n = candidates.point[row], candidates.normal[row]
    C, (R, o) = candidates.covariance[row], frame
    t1, t2 = tangents(vector(n))
    # Root of the covariance in the tangent plane: v = (a u1, b u1 + d u2).
    a = math.sqrt(max(v11, 1e-18))
    b = v12 / a
    d = math.sqrt(max(v22 - b * b, 0.0))
    axes = (add_scaled(scale(a, t1), b, t2), scale(d, t2))
    kind, size, points = surfaces.kind[p], surfaces.size[p], candidates.points
    spread_points(kind, size, frame, vector(c), axes, points)
    for k in range(near):
        q = candidates.near[k]
        height = _free_height(surfaces, q, surfaces.link[p], prior.clearance)
        cover_points(surface, q, height, points)
    share, (mx, my, mz), (xx, xy, xz, yy, yz, zz) = accessible_moments(
        vector(c), prior.surface_deviation / PENETRATION_SCALE, points
    )
    candidates.score[row] += math.log(share)
    if share > FULLY_ACCESSIBLE:
        return
    start, across, force = vector(c), vector(n), vector(candidates.force[row])
    mean = (mx / share, my / share, mz / share)
    body = rotate_back(R, subtract(add(start, mean), vector(o)))
    _, px, py, pz, nx, ny, nz = project(kind, size, body[0], body[1], body[2])
    point, normal = add(vector(o), rotate(R, (px, py, pz))), rotate(R, (nx, ny, nz))
    # Around an edge, the force may pull.
    if dot(force, normal) >= 0.0:
        point, normal = start, across
    second = (xx / share, xy / share, xz / share, yy / share, yz / share, zz / share)
    xx, xy, xz, yy, yz, zz = about_another_point(second, mean, subtract(point, start))
    # How far the surface may be from the primitive there does not depend on what covers it.
    s = dot(across, matvec((vector(C[0]), vector(C[1]), vector(C[2])), across))
    x, y, z = across
    moments = (xx + s * x * x, xy + s * x * y, xz + s * x * z, yy + s * y * y, yz + s * y * z, zz + s * z * z)
    write_moments(moments, C)
    for i in range(3):
        c[i], n[i] = point[i], normal[i]


@fused_kernel
def is_mounting_face(link: int, z: float, nz: float, spread: float) -> bool:
    """Whether a point is on the mounting face of the base link, which cannot be touched.

    Args:
        link: Index of the link.
        z: Height above the mounting plane z = 0 of the base frame [m].
        nz: z component of the outward normal.
        spread: Tolerance of the height [m].
    """
    return link == 0 and z < spread and nz < MOUNTING_FACE_NORMAL
