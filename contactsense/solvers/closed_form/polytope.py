"""Rounded convex polytope, a mesh's hull plus a ball: faces, edges and vertices in closed form.

Exactly one patch contains the contact. The kernel tests them, faces first, and excludes most by one
comparison.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, add_scaled, cross, divide, dot, norm, scale, vector
from contactsense.sensors.validation import as_floats
from contactsense.solvers.closed_form.ellipsoid import unit_sphere
from contactsense.solvers.closed_form.patch import Patch, nearer, no_patch, on_patch
from contactsense.solvers.closed_form.wrench_axis import line_answer
from contactsense.solvers.solution import (
    FAR,
    MISS,
    NOT_CONVERGED,
    OK,
    PATCH_TOLERANCE,
    SHARP,
    Answer,
    has_point,
    input_status,
    make_answer,
    no_contact,
    torsion,
)
from contactsense.solvers.units import Units, exponent, from_units, length_to_units, to_units, units_for
from contactsense.solvers.wrench import Wrench, about, invariant, line_point, moment_about, pure_force


class Hull(NamedTuple):
    """A convex polytope in contiguous arrays, about its middle and in its own unit of length, a power of
    two."""

    normal: np.ndarray
    """Outward unit normals of the faces, shape (F, 3)."""
    offset: np.ndarray
    """Distances of their planes from the middle, shape (F,)."""
    face_start: np.ndarray
    """First side of each face, and their number at the end, shape (F + 1,)."""
    side: np.ndarray
    """For each side of each face the unit vector in the face that points out across it, shape (K, 3)."""
    side_offset: np.ndarray
    """Largest value of side . p in the face, shape (K,)."""
    edge: np.ndarray
    """Start, direction, and the two faces' side vectors of each edge, shape (E, 4, 3)."""
    length: np.ndarray
    """Lengths of the edges, shape (E,)."""
    vertex: np.ndarray
    """Vertices, shape (V, 3)."""
    vertex_start: np.ndarray
    """First outgoing edge of each vertex, and their number at the end, shape (V + 1,)."""
    outgoing: np.ndarray
    """Unit vectors along the edges that leave each vertex, shape (2 E, 3)."""
    reach: float
    """Radius of the ball about the middle that holds the hull."""
    middle: np.ndarray
    """Middle in the frame of the points, in that unit, shape (3,)."""
    unit: float
    """Unit of length [m]."""


def hull_of(points: ArrayLike) -> Hull:
    """The convex hull of points [m], shape (N, 3), not all in one plane, as the kernel takes it.

    Raises:
        ValueError: The points have another shape, are not finite, or span no volume.
    """
    cloud = np.array(as_floats("Polytope: points", points))
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not np.all(np.isfinite(cloud)):
        raise ValueError(f"Polytope: points must be finite and of shape (N, 3), not {cloud.shape}")
    k = int(np.frexp(np.ptp(cloud, axis=0).max())[1]) if len(cloud) else 0
    cloud = np.ldexp(cloud, -k)
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    cloud -= middle
    try:
        found = ConvexHull(cloud)
    except QhullError:
        raise ValueError(
            f"Polytope: points must span a volume, not {len(cloud)} in one plane or on one line"
        ) from None
    size = float(np.abs(cloud).max())
    faces: list[tuple[np.ndarray, set[int]]] = []
    for equation, corners in zip(found.equations, found.simplices, strict=True):
        for plane, members in faces:
            if np.abs(plane[:3] - equation[:3]).max() < 1e-9 and abs(plane[3] - equation[3]) < 1e-9 * size:
                members.update(int(corner) for corner in corners)
                break
        else:
            faces.append((equation, {int(corner) for corner in corners}))
    normal = np.array([plane[:3] for plane, _ in faces])
    rings = [_ring(cloud, plane[:3], sorted(members)) for plane, members in faces]
    corners_of = sorted({corner for ring in rings for corner in ring})
    sides: dict[tuple[int, int], np.ndarray] = {}
    side, side_offset, face_start = [], [], [0]
    for n, ring in zip(normal, rings, strict=True):
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            out = np.cross(cloud[b] - cloud[a], n)
            out /= np.linalg.norm(out)
            sides[a, b] = out
            side.append(out)
            side_offset.append(out @ cloud[a])
        face_start.append(len(side))
    edges, length = [], []
    leaving: dict[int, list[np.ndarray]] = {corner: [] for corner in corners_of}
    for (a, b), out in sides.items():
        along = cloud[b] - cloud[a]
        size_of = float(np.linalg.norm(along))
        leaving[a].append(along / size_of)
        if a < b:
            edges.append((cloud[a], along / size_of, out, sides[b, a]))
            length.append(size_of)
    return Hull(
        normal=normal,
        offset=np.array([-plane[3] for plane, _ in faces]),
        face_start=np.array(face_start),
        side=np.array(side),
        side_offset=np.array(side_offset),
        edge=np.array(edges),
        length=np.array(length),
        vertex=cloud[corners_of],
        vertex_start=np.concatenate(([0], np.cumsum([len(leaving[corner]) for corner in corners_of]))),
        outgoing=np.array([along for corner in corners_of for along in leaving[corner]]),
        reach=float(np.linalg.norm(cloud[corners_of], axis=1).max()),
        middle=middle,
        unit=float(np.ldexp(1.0, k)),
    )


def _ring(cloud: np.ndarray, normal: np.ndarray, members: list[int]) -> list[int]:
    """Corners of a face in order around its normal, without those inside an edge or the face."""
    if len(members) > 3:
        axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
        u = np.cross(normal, axis)
        u /= np.linalg.norm(u)
        flat = cloud[members] @ np.column_stack((u, np.cross(normal, u)))
        members = [members[k] for k in ConvexHull(flat).vertices]
        return members
    a, b, c = (cloud[k] for k in members)
    return members if np.cross(b - a, c - a) @ normal > 0.0 else members[::-1]


@kernel
def _entry(wrench: Wrench, hull: Hull) -> tuple[bool, Vector, Vector]:
    """Whether the force's line enters the hull, where, and the normal of the face there."""
    f = wrench.force
    p = line_point(wrench)
    first, last = -FAR, FAR
    n = (0.0, 0.0, 0.0)
    for i in range(hull.offset.shape[0]):
        a = vector(hull.normal[i])
        push = dot(a, f)
        gap = hull.offset[i] - dot(a, p)
        if push < 0.0:
            at = gap / push
            if at > first:
                first, n = at, a
        elif push > 0.0:
            last = min(last, gap / push)
        elif gap < 0.0:
            last = -FAR
    return first < last, add_scaled(p, first, f), n


@kernel
def _best_face(wrench: Wrench, hull: Hull, r: float) -> Patch:
    """Contact on the face whose patch it is nearest to."""
    f, m = wrench
    best = no_patch(0)
    for i in range(hull.offset.shape[0]):
        n = vector(hull.normal[i])
        push = dot(n, f)
        if push < 0.0:
            c = divide(add_scaled(cross(n, m), hull.offset[i] + r, f), push)
            core = add_scaled(c, -r, n)
            outside = -FAR
            for k in range(hull.face_start[i], hull.face_start[i + 1]):
                outside = max(outside, dot(vector(hull.side[k]), core) - hull.side_offset[k])
            if outside < best.outside:
                best = Patch(outside, core, n, 0)
                if outside <= 0.0:
                    break
    return best


@kernel
def _best_edge(wrench: Wrench, hull: Hull, r: float) -> Patch:
    """Contact on the edge whose patch it is nearest to."""
    f = wrench.force
    reach = hull.reach + r
    best = no_patch(1)
    for i in range(hull.length.shape[0]):
        start, d = vector(hull.edge[i, 0]), vector(hull.edge[i, 1])
        moment = moment_about(wrench, start)
        # As on a cylinder: e.p = about, p = r f x d.
        about_edge = dot(moment, d)
        u = scale(r, cross(f, d))
        uu = dot(u, u)
        disc = uu - about_edge * about_edge
        if disc > 0.0:
            n = add_scaled(scale(about_edge / uu, u), -(sqrt(disc) / uu), cross(d, u))
            push = dot(n, f)
            at = (dot(moment, cross(d, n)) + r * dot(f, d)) / push
            beside = min(dot(n, vector(hull.edge[i, 2])), dot(n, vector(hull.edge[i, 3])))
            outside = max(max(at - hull.length[i], -at), -reach * beside)
            if push < 0.0 and outside < best.outside:
                best = Patch(outside, add_scaled(start, at, d), n, 1)
                if outside <= 0.0:
                    break
    return best


@kernel
def _best_vertex(wrench: Wrench, hull: Hull, r: float) -> Patch:
    """Contact on the vertex whose patch it is nearest to."""
    reach = hull.reach + r
    u, tau = scale(r, wrench.force), r * invariant(wrench)
    best = no_patch(2)
    for i in range(hull.vertex.shape[0]):
        corner = vector(hull.vertex[i])
        status, n, _ = unit_sphere(u, moment_about(wrench, corner), tau)
        outside = -FAR
        for k in range(hull.vertex_start[i], hull.vertex_start[i + 1]):
            outside = max(outside, reach * dot(n, vector(hull.outgoing[k])))
        if status == OK and outside < best.outside:
            best = Patch(outside, corner, n, 2)
            if outside <= 0.0:
                break
    return best


@kernel
def _polytope(wrench: Wrench, hull: Hull, r: float) -> Answer:
    best = _best_face(wrench, hull, r)
    if best.outside > 0.0 and r > 0.0:
        best = nearer(best, _best_edge(wrench, hull, r))
        if best.outside > 0.0:
            best = nearer(best, _best_vertex(wrench, hull, r))
    if best.outside <= PATCH_TOLERANCE * (hull.reach + r):
        return on_patch(OK, wrench, best, r)
    status = MISS if r == 0.0 or invariant(wrench) == 0.0 else NOT_CONVERGED
    if best.outside == FAR:
        return no_contact(status)
    if r == 0.0:
        entered, c, n = _entry(wrench, hull)
        if entered:
            return make_answer(SHARP, wrench, c, n, torsion(wrench, c, n), 0.0, 0.0)
    return on_patch(status, wrench, best, r)


@kernel
def _in_its_frame(wrench: Wrench, hull: Hull) -> tuple[Wrench, Units]:
    """The wrench about the hull's middle, in units of order one, and these units."""
    middle = vector(hull.middle)
    far = 1.0 + max(abs(middle[0]), abs(middle[1]), abs(middle[2]))
    units = units_for(wrench, hull.unit * far)
    units = Units(units.force, units.moment, exponent(hull.unit) - 1)
    return about(to_units(wrench, units), middle), units


@kernel
def _placed(answer: Answer, hull: Hull, units: Units) -> Answer:
    """An answer in that frame and those units, in the frame of the points."""
    c = add(answer.centroid, vector(hull.middle)) if has_point(answer) else answer.centroid
    moved = Answer(answer.status, c, answer.normal, answer.torsion, answer.residual, answer.condition)
    return from_units(moved, units)


@kernel
def solve_polytope(wrench: Wrench, hull: Hull, rounding: float) -> Answer:
    """Contact centroid on a convex polytope plus a ball.

    Args:
        wrench: Wrench on the body.
        hull: The polytope.
        rounding: Radius of the ball. May be zero: the status is `SHARP` for a wrench that enters no face,
            where its axis enters.

    Returns:
        See `contactsense.solvers.solution`. A miss returns a point on the patch with the smallest
        violation, not the nearest point.
    """
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    local, units = _in_its_frame(wrench, hull)
    return _placed(_polytope(local, hull, length_to_units(rounding, units)), hull, units)


@kernel
def wrench_axis_polytope(wrench: Wrench, hull: Hull, rounding: float) -> Answer:
    """Point where the wrench axis enters a convex polytope plus a ball: the contact without the moment
    along the force."""
    status = input_status(wrench)
    if status != OK:
        return no_contact(status)
    local, units = _in_its_frame(wrench, hull)
    rounding = length_to_units(rounding, units)
    largest = PATCH_TOLERANCE * (hull.reach + rounding) * norm(local.force)
    answer = _polytope(pure_force(local), hull, rounding)
    return _placed(line_answer(answer, local, largest), hull, units)
