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

from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.solvers.posterior.simd import project_others, project_place

from contactsense.solvers.posterior.block import (  # isort: skip
    AT, AX, AY, AZ, BX, BY, BZ, CX, CY, CZ, DISTANCE, ENTRY, GAP, LEFT, LEFT_DISTANCE, LEFT_SLOPE, LX, LY,
    LZ, NX, NY, NZ, P0, P1, P2, P3, RADIUS, RIGHT, RIGHT_DISTANCE, RIGHT_SLOPE, UX, UY, UZ, W0, W1, W2,
    W3, W4, W5,
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
    _start_outside(block)
    for _ in range(_MAX_ITERATIONS):
        _project_lines(block)
        project_others(kind, size, primitives, block)
        _step_along_lines(block)
        approaching = False
        for j in range(primitives.shape[0]):
            approaching = approaching or block[ENTRY + j] == _APPROACHING
        if not approaching:
            break
    _move_upstream(block)
    _project_lines(block)
    project_others(kind, size, primitives, block)
    _take_nearest_approaches(block)


@fused_kernel
def _start_outside(block: np.ndarray) -> None:
    """Start on each line where it enters the bounding ball or, of a body of revolution, the bounding can."""
    for j in range(LANES):
        fx, fy, fz = block[W0 + j], block[W1 + j], block[W2 + j]
        mx, my, mz = block[W3 + j], block[W4 + j], block[W5 + j]
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
        at_ball = -1.001 * block[RADIUS + j]
        across = ux * ux + uy * uy
        inverse_across = 1.0 / max(across, 1e-12)
        middle = -(ax * ux + ay * uy) * inverse_across
        max_radius = max(block[P1 + j], block[P2 + j]) + block[P3 + j]
        squared = middle * middle - (ax * ax + ay * ay - max_radius * max_radius) * inverse_across
        at_side = middle - math.sqrt(max(squared, 0.0))
        size_along = max(abs(uz), 1e-9)
        at_end = -(block[P0 + j] + block[P3 + j]) / size_along - (az if uz > 0.0 else -az) / size_along
        at_side = at_side if (across > 1e-12) & (squared > 0.0) else at_ball
        at_end = at_end if abs(uz) > 1e-9 else at_ball
        block[UX + j], block[UY + j], block[UZ + j] = ux, uy, uz
        block[LX + j], block[LY + j], block[LZ + j] = ax, ay, az
        block[AT + j] = max(at_ball, max(at_side, at_end))
        block[LEFT + j], block[LEFT_DISTANCE + j], block[LEFT_SLOPE + j] = 0.0, 0.0, 0.0
        block[RIGHT + j], block[RIGHT_DISTANCE + j], block[RIGHT_SLOPE + j] = 0.0, 0.0, -1.0
        block[GAP + j], block[ENTRY + j] = 0.0, _APPROACHING


@fused_kernel
def _project_lines(block: np.ndarray) -> None:
    """Project the places on the lines onto the surfaces, of bodies of revolution."""
    for j in range(LANES):
        at = block[AT + j]
        place = (
            block[LX + j] + at * block[UX + j],
            block[LY + j] + at * block[UY + j],
            block[LZ + j] + at * block[UZ + j],
        )
        project_place(j, place, block)


@fused_kernel
def _step_along_lines(block: np.ndarray) -> None:
    """Take a surface point where the line has entered; elsewhere go on to the next place."""
    for j in range(LANES):
        at, distance, radius = block[AT + j], block[DISTANCE + j], block[RADIUS + j]
        x, y, z, nx, ny, nz = (
            block[AX + j], block[AY + j], block[AZ + j], block[BX + j], block[BY + j], block[BZ + j],
        )  # fmt: skip
        slope = nx * block[UX + j] + ny * block[UY + j] + nz * block[UZ + j]
        approaching = block[ENTRY + j] == _APPROACHING
        before = slope < 0.0
        entered = approaching & before & (distance <= ENTRY_TOLERANCE * radius)
        left = at if before else block[LEFT + j]
        left_distance = distance if before else block[LEFT_DISTANCE + j]
        left_slope = slope if before else block[LEFT_SLOPE + j]
        right = block[RIGHT + j] if before else at
        right_distance = block[RIGHT_DISTANCE + j] if before else distance
        right_slope = block[RIGHT_SLOPE + j] if before else slope
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
        block[AT + j] = step if approaching else at
        block[LEFT + j], block[LEFT_DISTANCE + j], block[LEFT_SLOPE + j] = left, left_distance, left_slope
        block[RIGHT + j], block[RIGHT_DISTANCE + j], block[RIGHT_SLOPE + j] = (
            right,
            right_distance,
            right_slope,
        )
        block[GAP + j] = gap if approaching & bracketed & (not entered) else block[GAP + j]
        block[CX + j] = x if entered else block[CX + j]
        block[CY + j] = y if entered else block[CY + j]
        block[CZ + j] = z if entered else block[CZ + j]
        block[NX + j] = nx if entered else block[NX + j]
        block[NY + j] = ny if entered else block[NY + j]
        block[NZ + j] = nz if entered else block[NZ + j]
        state = _ENTERED if entered else block[ENTRY + j]
        block[ENTRY + j] = _MISSED if missed else state


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
