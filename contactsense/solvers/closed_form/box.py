"""Rounded box: six faces (planes), twelve edges (cylinders) and eight corners (spheres), in closed form.

Exactly one patch contains the contact. Most patches are excluded by one comparison: the force must push
on a face, and its line must not miss an edge. If rounding errors place the contact outside every patch,
the nearest patch is used.
"""

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import BOX
from contactsense.robots.vectors import Vector, dot, norm, scale
from contactsense.solvers.closed_form.cylinder import directions
from contactsense.solvers.closed_form.ellipsoid import unit_sphere
from contactsense.solvers.closed_form.nearest_point import enter, nearest_to_line
from contactsense.solvers.closed_form.patch import Patch, nearer, no_patch, on_patch
from contactsense.solvers.solution import (
    NOT_CONVERGED,
    OK,
    PATCH_TOLERANCE,
    SHARP,
    Answer,
    no_contact,
    with_status,
)
from contactsense.solvers.units import LARGE, SMALL, from_units, in_units, length_to_units, scale_by_power
from contactsense.solvers.wrench import Wrench, invariant, moment_about


@kernel
def _turned(a: Vector, axis: int) -> Vector:
    """A vector with its components in cyclic order, `axis` as z."""
    if axis == 0:
        return a[1], a[2], a[0]
    if axis == 1:
        return a[2], a[0], a[1]
    return a


@kernel
def _turned_wrench(wrench: Wrench, axis: int) -> Wrench:
    return Wrench(_turned(wrench.force, axis), _turned(wrench.moment, axis))


@kernel
def _turned_back(patch: Patch, axis: int) -> Patch:
    # A turn with x as z is the inverse of that with y as z.
    back = 2 if axis == 2 else 1 - axis
    return Patch(patch.outside, _turned(patch.core, back), _turned(patch.normal, back), patch.curved)


@kernel
def _face(wrench: Wrench, half: Vector, r: float) -> Patch:
    """Contact on the face perpendicular to z that the force pushes on."""
    f, m = wrench
    if f[2] == 0.0:
        return no_patch(0)
    sign = -1.0 if f[2] > 0.0 else 1.0
    top = sign * (half[2] + r)
    x, y = (top * f[0] - m[1]) / f[2], (top * f[1] + m[0]) / f[2]
    return Patch(max(abs(x) - half[0], abs(y) - half[1]), (x, y, sign * half[2]), (0.0, 0.0, sign), 0)


@kernel
def _edges(wrench: Wrench, half: Vector, r: float, reach: float) -> Patch:
    """Contact on the edge along z whose patch it is nearest to."""
    f = wrench.force
    best = no_patch(1)
    limit = r * r * (f[0] * f[0] + f[1] * f[1])
    # First the edge on the side that the force comes from.
    likely = (1 if f[0] > 0.0 else 0) + (2 if f[1] > 0.0 else 0)
    for turn in range(4):
        k = likely ^ turn
        sx, sy = 1.0 - 2.0 * (k & 1), 1.0 - (k & 2)
        px, py = sx * half[0], sy * half[1]
        moment = moment_about(wrench, (px, py, 0.0))
        if moment[2] * moment[2] < limit:
            disc, a, b, u, v = directions(Wrench(f, moment), r, 0.0)
            ex, ey = a - u, b - v
            push = ex * f[0] + ey * f[1]
            if disc > 0.0 and push < 0.0:
                at = (ex * moment[1] - ey * moment[0] + r * f[2]) / push
                outside = max(abs(at) - half[2], -reach * min(sx * ex, sy * ey))
                if outside < best.outside:
                    best = Patch(outside, (px, py, at), (ex, ey, 0.0), 1)
                    if outside <= 0.0:
                        break
    return best


@kernel
def _corners(wrench: Wrench, half: Vector, r: float, reach: float) -> Patch:
    """Contact on the corner whose patch it is nearest to."""
    f = wrench.force
    best = no_patch(2)
    u = scale(r, f)
    tau = r * invariant(wrench)
    likely = (1 if f[0] > 0.0 else 0) + (2 if f[1] > 0.0 else 0) + (4 if f[2] > 0.0 else 0)
    for turn in range(8):
        k = likely ^ turn
        sx, sy, sz = 1.0 - 2.0 * (k & 1), 1.0 - (k & 2), 1.0 - 0.5 * (k & 4)
        corner = (sx * half[0], sy * half[1], sz * half[2])
        status, n, _ = unit_sphere(u, moment_about(wrench, corner), tau)
        outside = -reach * min(sx * n[0], sy * n[1], sz * n[2])
        if status == OK and outside < best.outside:
            best = Patch(outside, corner, n, 2)
            if outside <= 0.0:
                break
    return best


@kernel
def patch_of_box(wrench: Wrench, half: Vector, r: float) -> Patch:
    """The patch that contains the contact, or the nearest to it."""
    reach = norm(half) + r
    best = no_patch(0)
    # Each axis in turn is z.
    for axis in range(3):
        best = nearer(best, _turned_back(_face(_turned_wrench(wrench, axis), _turned(half, axis), r), axis))
        if best.outside <= 0.0:
            return best
    if r > 0.0:
        for axis in range(3):
            patch = _turned_back(_edges(_turned_wrench(wrench, axis), _turned(half, axis), r, reach), axis)
            best = nearer(best, patch)
            if best.outside <= 0.0:
                return best
        best = nearer(best, _corners(wrench, half, r, reach))
    return best


@kernel
def _box(wrench: Wrench, half: Vector, r: float) -> Answer:
    reach = norm(half) + r
    patch = patch_of_box(wrench, half, r)
    if patch.outside <= PATCH_TOLERANCE * reach:
        return on_patch(OK, wrench, patch, r)
    size = (half[0], half[1], half[2], r)
    if r == 0.0:
        answer = enter(BOX, size, reach, wrench)
        return with_status(answer, SHARP) if answer.status == OK else answer
    answer = nearest_to_line(BOX, size, reach, wrench)
    return answer if invariant(wrench) == 0.0 else with_status(answer, NOT_CONVERGED)


@kernel
def solve_box(wrench: Wrench, half: Vector, rounding: float) -> Answer:
    """Contact centroid on a box about the origin plus a ball: the `BOX` of
    `contactsense.robots.surface.convex_primitives`.

    Args:
        wrench: Wrench on the body.
        half: Half edge lengths of the box (without the ball), may be zero.
        rounding: Radius of the ball. May be zero: the status is `SHARP` for a wrench that enters no face,
            where its axis enters.

    Returns:
        See `contactsense.solvers.solution`.
    """
    f, m = wrench
    size = max(half[0], half[1], half[2]) + rounding
    ff = dot(f, f)
    round_enough = rounding == 0.0 or rounding * rounding * ff > SMALL
    if ff > SMALL and round_enough and size * size * ff < LARGE and dot(m, m) < LARGE:
        return _box(wrench, half, rounding)
    status, local, units = in_units(wrench, size)
    if status != OK:
        return no_contact(status)
    half, rounding = scale_by_power(half, -units.length), length_to_units(rounding, units)
    return from_units(_box(local, half, rounding), units)
