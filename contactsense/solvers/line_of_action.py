"""Intersections of the lines of action of measured forces with primitives (the paper, section 4), one
primitive in each lane of the processor's vector registers.

The line of action (wrench axis) is where the moment is parallel to the force. Its first intersection with
a primitive is the initial guess for the contact. The signed distance to a convex body is a convex function
along a line, so Newton's method, started outside, converges monotonically to the first intersection. If
the line misses the body, the guess is the nearest point of the body, moved towards the side on which the
force pushes.
"""

import math

import numpy as np

from contactsense.robots.jit.array_views import block as view
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import HALF, LANES
from contactsense.solvers.simd_posterior import project_others, project_place

from contactsense.solvers.posterior_block import (  # isort: skip
    AT, AX, AY, AZ, BX, BY, BZ, CX, CY, CZ, DISTANCE, ENTRY, GAP, LEFT, LEFT_DISTANCE, LEFT_SLOPE, LENGTH,
    LX, LY, LZ, NX, NY, NZ, P0, P1, P2, P3, RADIUS, RIGHT, RIGHT_DISTANCE, RIGHT_SLOPE, UX, UY, UZ, W0,
    W1, W2, W3, W4, W5,
)  # fmt: skip

_MAX_ITERATIONS = 30
ENTRY_TOLERANCE = 1e-4
"""Distance from the surface at which the line counts as having entered, relative to the bounding radius."""
_GAP_TOLERANCE = 0.02
"""Error of the distance between line and surface, relative to the bounding radius."""
_APPROACHING, _ENTERED, _MISSED = 0.0, 1.0, 2.0
"""Values of `ENTRY`."""


@fused_kernel
def enter_surfaces(kind: np.ndarray, size: np.ndarray, primitives: np.ndarray, block: np.ndarray) -> None:
    """Points where the lines of action enter the primitives.

    Args:
        kind, size: Primitives, as in `contactsense.robots.surface.convex_primitives.Surfaces`.
        primitives: The number of that of each lane in use, shape (lanes,), int64.
        block: The block, with primitives and wrenches in their body frames. Filled: `CX` to `NZ`, surface
            point [m] and outward unit normal at the intersection or the nearest approach, body frame; `GAP`,
            lower bound of the distance between line and body [m], 0 if they intersect.
    """
    lanes = primitives.shape[0]
    _start_outside(lanes, block)
    for _ in range(_MAX_ITERATIONS):
        _project_lines(lanes, block)
        project_others(kind, size, primitives, block)
        _step_along_lines(lanes, block)
        approaching = False
        for j in range(lanes):
            approaching = approaching or block[ENTRY + j] == _APPROACHING
        if not approaching:
            break
    _move_upstream(block)
    _project_lines(lanes, block)
    project_others(kind, size, primitives, block)
    _take_nearest_approaches(block)


@fused_kernel
def _start_outside(lanes: int, block: np.ndarray) -> None:
    """Start on each line where it enters the bounding ball or, of a body of revolution, the bounding can."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            fx, fy, fz = half[W0 + j], half[W1 + j], half[W2 + j]
            mx, my, mz = half[W3 + j], half[W4 + j], half[W5 + j]
            # Finite without a force, too.
            inverse = 1.0 / max(fx * fx + fy * fy + fz * fz, 1e-300)
            scale = math.sqrt(inverse)
            ux, uy, uz = fx * scale, fy * scale, fz * scale
            # Point of the line nearest to the body's centre (paper, equation 6).
            ax, ay, az = (
                (fy * mz - fz * my) * inverse,
                (fz * mx - fx * mz) * inverse,
                (fx * my - fy * mx) * inverse,
            )
            at_ball = -1.001 * half[RADIUS + j]
            across = ux * ux + uy * uy
            inverse_across = 1.0 / max(across, 1e-12)
            middle = -(ax * ux + ay * uy) * inverse_across
            max_radius = max(half[P1 + j], half[P2 + j]) + half[P3 + j]
            squared = middle * middle - (ax * ax + ay * ay - max_radius * max_radius) * inverse_across
            at_side = middle - math.sqrt(max(squared, 0.0))
            size_along = max(abs(uz), 1e-9)
            at_end = -(half[P0 + j] + half[P3 + j]) / size_along - (az if uz > 0.0 else -az) / size_along
            at_side = at_side if (across > 1e-12) & (squared > 0.0) else at_ball
            at_end = at_end if abs(uz) > 1e-9 else at_ball
            half[UX + j], half[UY + j], half[UZ + j] = ux, uy, uz
            half[LX + j], half[LY + j], half[LZ + j] = ax, ay, az
            half[AT + j] = max(at_ball, max(at_side, at_end))
            half[LEFT + j], half[LEFT_DISTANCE + j], half[LEFT_SLOPE + j] = 0.0, 0.0, 0.0
            half[RIGHT + j], half[RIGHT_DISTANCE + j], half[RIGHT_SLOPE + j] = 0.0, 0.0, -1.0
            half[GAP + j], half[ENTRY + j] = 0.0, _APPROACHING


@fused_kernel
def _project_lines(lanes: int, block: np.ndarray) -> None:
    """Project the places on the lines onto the surfaces, of bodies of revolution."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            at = half[AT + j]
            place = (
                half[LX + j] + at * half[UX + j],
                half[LY + j] + at * half[UY + j],
                half[LZ + j] + at * half[UZ + j],
            )
            project_place(j, place, half)


@fused_kernel
def _step_along_lines(lanes: int, block: np.ndarray) -> None:
    """Take a surface point where the line has entered; elsewhere go on to the next place."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            at, distance, radius = half[AT + j], half[DISTANCE + j], half[RADIUS + j]
            x, y, z, nx, ny, nz = (
                half[AX + j], half[AY + j], half[AZ + j], half[BX + j], half[BY + j], half[BZ + j],
            )  # fmt: skip
            slope = nx * half[UX + j] + ny * half[UY + j] + nz * half[UZ + j]
            approaching = half[ENTRY + j] == _APPROACHING
            before = slope < 0.0
            entered = approaching & before & (distance <= ENTRY_TOLERANCE * radius)
            left = at if before else half[LEFT + j]
            left_distance = distance if before else half[LEFT_DISTANCE + j]
            left_slope = slope if before else half[LEFT_SLOPE + j]
            right = half[RIGHT + j] if before else at
            right_distance = half[RIGHT_DISTANCE + j] if before else distance
            right_slope = half[RIGHT_SLOPE + j] if before else slope
            # The nearest approach is bracketed if there is a place on both sides. The convex distance lies
            # above both tangents, so their intersection is a lower bound.
            bracketed = (left_slope < 0.0) & (right_slope >= 0.0)
            meet = (left_distance - right_distance + right_slope * right - left_slope * left) / (
                right_slope - left_slope
            )
            gap = left_distance + left_slope * (meet - left)
            missed = (
                approaching
                & bracketed
                & (not entered)
                & (min(left_distance, right_distance) - gap < _GAP_TOLERANCE * radius)
            )
            # Otherwise a Newton step to the zero of the tangent.
            newton = at - distance / slope
            forward = min(newton, 1.001 * radius)
            back = max(newton, -1.001 * radius) if slope > 0.0 else -1.001 * radius
            step = forward if before else back
            step = meet if bracketed else step
            half[AT + j] = step if approaching else at
            half[LEFT + j], half[LEFT_DISTANCE + j], half[LEFT_SLOPE + j] = left, left_distance, left_slope
            half[RIGHT + j], half[RIGHT_DISTANCE + j], half[RIGHT_SLOPE + j] = (
                right,
                right_distance,
                right_slope,
            )
            half[GAP + j] = gap if approaching & bracketed & (not entered) else half[GAP + j]
            half[CX + j] = x if entered else half[CX + j]
            half[CY + j] = y if entered else half[CY + j]
            half[CZ + j] = z if entered else half[CZ + j]
            half[NX + j] = nx if entered else half[NX + j]
            half[NY + j] = ny if entered else half[NY + j]
            half[NZ + j] = nz if entered else half[NZ + j]
            state = _ENTERED if entered else half[ENTRY + j]
            half[ENTRY + j] = _MISSED if missed else state


@fused_kernel
def _move_upstream(block: np.ndarray) -> None:
    """Move to before the nearest approach of a line that misses its body, so that the force pushes."""
    for j in range(LANES):
        gap = 0.0 if block[ENTRY + j] == _ENTERED else max(block[GAP + j], 0.0)
        block[GAP + j] = gap
        block[AT + j] -= block[RADIUS + j] + gap


@fused_kernel
def _take_nearest_approaches(block: np.ndarray) -> None:
    """Surface points of the lines that miss their bodies."""
    for j in range(LANES):
        entered = block[ENTRY + j] == _ENTERED
        block[CX + j] = block[CX + j] if entered else block[AX + j]
        block[CY + j] = block[CY + j] if entered else block[AY + j]
        block[CZ + j] = block[CZ + j] if entered else block[AZ + j]
        block[NX + j] = block[NX + j] if entered else block[BX + j]
        block[NY + j] = block[NY + j] if entered else block[BY + j]
        block[NZ + j] = block[NZ + j] if entered else block[BZ + j]
