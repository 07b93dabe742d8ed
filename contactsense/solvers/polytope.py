"""Rounded convex polytope, a mesh's hull plus a ball: faces, edges and vertices in closed form.

Exactly one patch contains the contact. The kernel tests them, faces first, and excludes most by one
comparison.
"""

from math import frexp, ldexp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from contactsense.solvers.ellipsoid import unit_sphere
from contactsense.solvers.solution import (
    MISS,
    NOT_CONVERGED,
    OK,
    SHARP,
    Answer,
    input_status,
    invariant,
    make_answer,
    no_contact,
    rescaled,
    scaled,
    torsion,
    unit_exponents,
)
from contactsense.solvers.typed_kernel import kernel
from contactsense.solvers.wrench_axis import line_moment

_PATCH_TOLERANCE = 1e-9
"""How far outside of its patch, relative to the size of the body, a contact may lie by rounding."""

_FAR = 1e300


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
        ValueError: The points have another shape, or are not finite.
        scipy.spatial.QhullError: The points span no volume.
    """
    cloud = np.asarray(points, dtype=float)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not np.all(np.isfinite(cloud)):
        raise ValueError(f"Polytope: points must be finite and of shape (N, 3), not {cloud.shape}")
    k = int(np.frexp(np.ptp(cloud, axis=0).max())[1]) if len(cloud) else 0
    cloud = np.ldexp(cloud, -k)
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    cloud -= middle
    found = ConvexHull(cloud)
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
def _entry(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, hull: Hull
) -> tuple[bool, float, float, float, float, float, float]:
    """Whether the force's line enters the hull, where, and the normal of the face there."""
    ff = fx * fx + fy * fy + fz * fz
    px, py, pz = (fy * mz - fz * my) / ff, (fz * mx - fx * mz) / ff, (fx * my - fy * mx) / ff
    first, last = -_FAR, _FAR
    nx = ny = nz = 0.0
    for i in range(hull.offset.shape[0]):
        ax, ay, az = hull.normal[i, 0], hull.normal[i, 1], hull.normal[i, 2]
        push = ax * fx + ay * fy + az * fz
        gap = hull.offset[i] - (ax * px + ay * py + az * pz)
        if push < 0.0:
            at = gap / push
            if at > first:
                first, nx, ny, nz = at, ax, ay, az
        elif push > 0.0:
            last = min(last, gap / push)
        elif gap < 0.0:
            last = -_FAR
    return first < last, px + first * fx, py + first * fy, pz + first * fz, nx, ny, nz


@kernel
def _polytope(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, hull: Hull, r: float
) -> Answer:
    reach = hull.reach + r
    t = invariant(fx, fy, fz, mx, my, mz)
    best = _FAR
    px = py = pz = nx = ny = nz = 0.0
    bends = 0
    for i in range(hull.offset.shape[0]):
        ax, ay, az = hull.normal[i, 0], hull.normal[i, 1], hull.normal[i, 2]
        push = ax * fx + ay * fy + az * fz
        if push < 0.0:
            top = hull.offset[i] + r
            qx = (ay * mz - az * my + top * fx) / push - r * ax
            qy = (az * mx - ax * mz + top * fy) / push - r * ay
            qz = (ax * my - ay * mx + top * fz) / push - r * az
            outside = -_FAR
            for k in range(hull.face_start[i], hull.face_start[i + 1]):
                over = (
                    hull.side[k, 0] * qx + hull.side[k, 1] * qy + hull.side[k, 2] * qz - hull.side_offset[k]
                )
                outside = max(outside, over)
            if outside < best:
                best, px, py, pz, nx, ny, nz = outside, qx, qy, qz, ax, ay, az
                if best <= 0.0:
                    break
    if best > 0.0 and r > 0.0:
        for i in range(hull.length.shape[0]):
            ox, oy, oz = hull.edge[i, 0, 0], hull.edge[i, 0, 1], hull.edge[i, 0, 2]
            dx, dy, dz = hull.edge[i, 1, 0], hull.edge[i, 1, 1], hull.edge[i, 1, 2]
            lx, ly, lz = mx - (oy * fz - oz * fy), my - (oz * fx - ox * fz), mz - (ox * fy - oy * fx)
            about = lx * dx + ly * dy + lz * dz
            # As on a cylinder: e.p = about, p = r f x d.
            ux, uy, uz = r * (fy * dz - fz * dy), r * (fz * dx - fx * dz), r * (fx * dy - fy * dx)
            uu = ux * ux + uy * uy + uz * uz
            disc = uu - about * about
            if disc > 0.0:
                along, across = about / uu, sqrt(disc) / uu
                ax = along * ux - across * (dy * uz - dz * uy)
                ay = along * uy - across * (dz * ux - dx * uz)
                az = along * uz - across * (dx * uy - dy * ux)
                push = ax * fx + ay * fy + az * fz
                m_theta = lx * (dy * az - dz * ay) + ly * (dz * ax - dx * az) + lz * (dx * ay - dy * ax)
                at = (m_theta + r * (fx * dx + fy * dy + fz * dz)) / push
                first = ax * hull.edge[i, 2, 0] + ay * hull.edge[i, 2, 1] + az * hull.edge[i, 2, 2]
                second = ax * hull.edge[i, 3, 0] + ay * hull.edge[i, 3, 1] + az * hull.edge[i, 3, 2]
                outside = max(max(at - hull.length[i], -at), -reach * min(first, second))
                if push < 0.0 and outside < best:
                    best, nx, ny, nz = outside, ax, ay, az
                    px, py, pz = ox + at * dx, oy + at * dy, oz + at * dz
                    bends = 1
                    if best <= 0.0:
                        break
    if best > 0.0 and r > 0.0:
        ux, uy, uz = r * fx, r * fy, r * fz
        uu = ux * ux + uy * uy + uz * uz
        for i in range(hull.vertex.shape[0]):
            ox, oy, oz = hull.vertex[i, 0], hull.vertex[i, 1], hull.vertex[i, 2]
            lx, ly, lz = mx - (oy * fz - oz * fy), my - (oz * fx - ox * fz), mz - (ox * fy - oy * fx)
            status, ax, ay, az, _ = unit_sphere(
                ux, uy, uz, lx, ly, lz, uu, lx * lx + ly * ly + lz * lz, r * t
            )
            outside = -_FAR
            for k in range(hull.vertex_start[i], hull.vertex_start[i + 1]):
                over = ax * hull.outgoing[k, 0] + ay * hull.outgoing[k, 1] + az * hull.outgoing[k, 2]
                outside = max(outside, reach * over)
            if status == OK and outside < best:
                best, px, py, pz, nx, ny, nz = outside, ox, oy, oz, ax, ay, az
                bends = 2
                if best <= 0.0:
                    break
    cx, cy, cz = px + r * nx, py + r * ny, pz + r * nz
    status = OK
    if best > _PATCH_TOLERANCE * reach:
        status = MISS if t == 0.0 or r == 0.0 else NOT_CONVERGED
        if best == _FAR:
            return no_contact(status)
        if r == 0.0:
            entered, ax, ay, az, ux, uy, uz = _entry(fx, fy, fz, mx, my, mz, hull)
            if entered:
                status, cx, cy, cz, nx, ny, nz = SHARP, ax, ay, az, ux, uy, uz
    bend = 1.0 / r if bends > 0 else 0.0
    xi = torsion(fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz)
    det = bend * bend if bends == 2 else 0.0
    return make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, xi, bends * bend, det)


@kernel
def _size(fx: float, fy: float, fz: float) -> float:
    return sqrt(fx * fx + fy * fy + fz * fz)


@kernel
def _in_its_frame(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, hull: Hull
) -> tuple[int, int, int, float, float, float, float, float, float]:
    """The wrench about the hull's middle, in units of order one, and the exponents of these units."""
    ox, oy, oz = hull.middle[0], hull.middle[1], hull.middle[2]
    k = frexp(hull.unit)[1] - 1
    far = 1.0 + max(abs(ox), abs(oy), abs(oz))
    e, g, _ = unit_exponents(fx, fy, fz, mx, my, mz, hull.unit * far)
    fx, fy, fz, mx, my, mz = scaled(fx, fy, fz, mx, my, mz, e, g, k)
    mx, my, mz = mx - (oy * fz - oz * fy), my - (oz * fx - ox * fz), mz - (ox * fy - oy * fx)
    return e, g, k, fx, fy, fz, mx, my, mz


@kernel
def _placed(answer: Answer, hull: Hull, e: int, g: int, k: int) -> Answer:
    """An answer in that frame and those units, in the frame of the points."""
    status, cx, cy, cz, nx, ny, nz, xi, residual, condition = answer
    if nx != 0.0 or ny != 0.0 or nz != 0.0:
        cx, cy, cz = cx + hull.middle[0], cy + hull.middle[1], cz + hull.middle[2]
    return rescaled((status, cx, cy, cz, nx, ny, nz, xi, residual, condition), e, g, k)


@kernel
def solve_polytope(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, hull: Hull, rounding: float
) -> Answer:
    """Contact centroid on a convex polytope plus a ball.

    Args:
        fx, fy, fz, mx, my, mz: Wrench on the body.
        hull: The polytope.
        rounding: Radius of the ball. May be zero: the status is `SHARP` for a wrench that enters no face,
            where its axis enters.

    Returns:
        See `contactsense.solvers.solution`. A miss returns a point on the patch with the smallest
        violation, not the nearest point.
    """
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k, fx, fy, fz, mx, my, mz = _in_its_frame(fx, fy, fz, mx, my, mz, hull)
    answer = _polytope(fx, fy, fz, mx, my, mz, hull, ldexp(rounding, -k))
    return _placed(answer, hull, e, g, k)


@kernel
def wrench_axis_polytope(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, hull: Hull, rounding: float
) -> Answer:
    """Point where the wrench axis enters a convex polytope plus a ball: the contact without the moment
    along the force."""
    status = input_status(fx, fy, fz, mx, my, mz)
    if status != OK:
        return no_contact(status)
    e, g, k, fx, fy, fz, mx, my, mz = _in_its_frame(fx, fy, fz, mx, my, mz, hull)
    rounding = ldexp(rounding, -k)
    lx, ly, lz = line_moment(fx, fy, fz, mx, my, mz)
    status, cx, cy, cz, nx, ny, nz, xi, _, _ = _polytope(fx, fy, fz, lx, ly, lz, hull, rounding)
    if status != OK or abs(xi) > _PATCH_TOLERANCE * (hull.reach + rounding) * _size(fx, fy, fz):
        # A contact at the rim would need a torsion that the wrench does not have.
        status = MISS
    if nx == 0.0 and ny == 0.0 and nz == 0.0:
        return no_contact(MISS)
    answer = make_answer(status, fx, fy, fz, mx, my, mz, cx, cy, cz, nx, ny, nz, 0.0, 0.0, 0.0)
    return _placed(answer, hull, e, g, k)
