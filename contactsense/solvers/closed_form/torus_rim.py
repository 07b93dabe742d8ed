"""Rounded rim: the outer half of a torus, the circle of radius `ring` about z plus a ball of radius r.

With the normal n = (cos a e, sin a), e the radial direction at the angle theta, the tangential moment has
the components

    F_theta = m_theta + ring f_z + r (cos a f_z - sin a f_rho)
    F_a     = cos a (m_z - ring f_theta) - sin a m_rho - r f_theta

Two equations in two angles, without a closed form (the polynomial has degree eight): Newton's method with a
line search, which has no local minima, because the Jacobian is regular wherever the force pushes
(`contactsense.solvers.general_convex.newton`). If only a part of the torus is a patch of a body, there is
still at most one contact, because the whole outer half belongs to a convex body, the disc plus the ball.
"""

from math import cos, inf, pi, sin, sqrt
from typing import NamedTuple

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import norm
from contactsense.solvers.solution import is_contact
from contactsense.solvers.wrench import Wrench, invariant

_STEPS = 40
_BEYOND = 1e-3
"""Cosine of elevation to which the iteration may stray onto the inner half, so that it can end close to a
cap."""

_HALVINGS = 20
_FLOOR = 4e-16
"""Rounding error of the tangential moment, relative to moment and lever."""

_BISECTIONS = 60
_SEGMENTS = 8
"""Parts of the elevation in which a change of sign is looked for."""

_STARTS_AROUND = 16
_STARTS_ACROSS = 24
_HEIGHTS = 3


class Rim(NamedTuple):
    """The ball of radius `r` about every point of a circle about the origin, in the plane square to z."""

    ring: float
    """Radius of the circle."""
    r: float
    """Radius of the ball."""


class Place(NamedTuple):
    """A place on a rim, by its normal (cos a e, sin a)."""

    ex: float
    """Radial direction e, x."""
    ey: float
    """Radial direction e, y."""
    ca: float
    """Cosine of the elevation a."""
    sa: float
    """Sine of the elevation a."""


class Balance(NamedTuple):
    """What a contact at a place of a rim leaves of the wrench."""

    around: float
    """Tangential moment F_theta."""
    across: float
    """Tangential moment F_a."""
    push: float
    """f.n."""


@kernel
def _rotate(c: float, s: float, angle: float) -> tuple[float, float]:
    """The direction (c, s) rotated by a small angle, by at most half a turn in any case."""
    half = 0.5 * angle
    denominator = 1.0 + half * half
    cos_turn, sin_turn = (1.0 - half * half) / denominator, angle / denominator
    c, s = c * cos_turn - s * sin_turn, s * cos_turn + c * sin_turn
    size = sqrt(c * c + s * s)
    return c / size, s / size


@kernel
def _components(wrench: Wrench, ex: float, ey: float) -> tuple[float, float, float, float]:
    """f_rho, f_theta, m_rho, m_theta in the radial direction (ex, ey)."""
    f, m = wrench
    return ex * f[0] + ey * f[1], ex * f[1] - ey * f[0], ex * m[0] + ey * m[1], ex * m[1] - ey * m[0]


@kernel
def _balance(wrench: Wrench, rim: Rim, place: Place) -> Balance:
    f, m = wrench
    ring, r = rim
    ex, ey, ca, sa = place
    f_rho, f_theta, m_rho, m_theta = _components(wrench, ex, ey)
    around = m_theta + ring * f[2] + r * (ca * f[2] - sa * f_rho)
    across = ca * (m[2] - ring * f_theta) - sa * m_rho - r * f_theta
    return Balance(around, across, ca * f_rho + sa * f[2])


@kernel
def pushes_at(t: float, wrench: Wrench, rim: Rim, place: Place) -> bool:
    """Whether a wrench with the invariant `t`, balanced at this place of the rim, pushes there."""
    f, m = wrench
    ring, r = rim
    ex, ey, ca, sa = place
    f_rho, f_theta, m_rho, _ = _components(wrench, ex, ey)
    xi = ca * m_rho + sa * (m[2] - ring * f_theta)
    return is_contact(t, xi, ca * f_rho + sa * f[2], max(ca, 0.0) / (r * (ring + r * ca)))


@kernel
def refine_rim(wrench: Wrench, rim: Rim, start: Place) -> tuple[bool, Place, int]:
    """Newton's method for the contact on a rim, from a start that is pushed at.

    Args:
        wrench: Wrench, moment about the circle's centre.
        rim: The rim.
        start: Start of the iteration.

    Returns:
        Whether a contact is found, its place (on the outer half of the torus), and the number of steps.
    """
    f, m = wrench
    ring, r = rim
    place = start
    around, across, push = _balance(wrench, rim, place)
    size = around * around + across * across
    step = 0
    t = invariant(wrench)
    # Rounding error of the moment.
    floor = _FLOOR * (norm(m) + (ring + r) * norm(f))
    for step in range(_STEPS):
        if size <= floor * floor:
            return pushes_at(t, wrench, rim, place), place, step
        ex, ey, ca, sa = place
        f_rho, f_theta, m_rho, m_theta = _components(wrench, ex, ey)
        # Derivatives of F_theta and F_a by both angles.
        tt = -m_rho - r * sa * f_theta
        ta = -r * push
        at = -sa * m_theta + (ca * ring + r) * f_rho
        aa = -ca * m_rho - sa * (m[2] - ring * f_theta)
        det = tt * aa - ta * at
        if det == 0.0:
            return False, place, step
        d_theta = (ta * across - aa * around) / det
        d_a = (at * around - tt * across) / det
        share = 1.0
        better = False
        for _ in range(_HALVINGS):
            ux, uy = _rotate(ex, ey, share * d_theta)
            uc, us = _rotate(ca, sa, share * d_a)
            if uc < -_BEYOND:
                uc, us = 0.0, (1.0 if us > 0.0 else -1.0)
            trial = Place(ux, uy, uc, us)
            new = _balance(wrench, rim, trial)
            new_size = new.around * new.around + new.across * new.across
            if new.push < 0.0 and new_size < size:
                better = True
                break
            share *= 0.5
        if not better:
            break
        place, size = trial, new_size
        around, across, push = new
    # No decrease: the solution at the limit of rounding, else there is none on this rim.
    found = size <= 100.0 * floor * floor and pushes_at(t, wrench, rim, place)
    return found, place, step


@kernel
def _elevation(wrench: Wrench, rim: Rim, place: Place) -> tuple[Place, float]:
    """The best of a place and the elevations that make F_a or F_theta zero in its radial direction.

    Returns:
        The place, and |F|^2 there; infinite where none of them is pushed at.
    """
    f, m = wrench
    ring, r = rim
    ex, ey, _, _ = place
    around, across, push = _balance(wrench, rim, place)
    lowest = around * around + across * across if push < 0.0 else inf
    f_rho, f_theta, m_rho, m_theta = _components(wrench, ex, ey)
    # F_a = 0 is a c - b s = d with two solutions, F_theta = 0 one with a single pushing one.
    a, b, d = m[2] - ring * f_theta, m_rho, r * f_theta
    root = sqrt(max(a * a + b * b - d * d, 0.0))
    projection = -(m_theta + ring * f[2]) / r
    push_root = sqrt(max(f_rho * f_rho + f[2] * f[2] - projection * projection, 0.0))
    for k in range(3):
        if k == 0:
            tc, ts = d * a - root * b, -root * a - d * b
        elif k == 1:
            tc, ts = d * a + root * b, root * a - d * b
        else:
            tc, ts = projection * f[2] - push_root * f_rho, -projection * f_rho - push_root * f[2]
        size = sqrt(tc * tc + ts * ts)
        if tc >= 0.0 and size > 0.0:
            trial = Place(ex, ey, tc / size, ts / size)
            around, across, push = _balance(wrench, rim, trial)
            squared_residual = around * around + across * across
            if push < 0.0 and squared_residual < lowest:
                place, lowest = trial, squared_residual
    return place, lowest


@kernel
def start_rim(wrench: Wrench, rim: Rim, ca: float, sa: float) -> tuple[bool, Place]:
    """A start for `refine_rim`: one equation exact around the axis at the elevation (ca, sa), one across.

    At a given elevation both equations are linear in the direction, as on a cylinder and on a cone.
    """
    f, m = wrench
    ring, r = rim
    rho, z, q = ring + r * ca, r * sa, ring * ca + r
    best = Place(0.0, 0.0, 0.0, 0.0)
    lowest = inf
    for k in range(4):
        if k < 2:
            px, py, along = m[1] - z * f[0], -m[0] - z * f[1], -rho * f[2]
        else:
            px, py, along = -sa * m[0] - q * f[1], q * f[0] - sa * m[1], -ca * m[2]
        root = sqrt(max(px * px + py * py - along * along, 0.0))
        if k % 2 == 0:
            root = -root
        ex, ey = along * px - root * py, along * py + root * px
        size = sqrt(ex * ex + ey * ey)
        if size > 0.0:
            place, squared_residual = _elevation(wrench, rim, Place(ex / size, ey / size, ca, sa))
            if squared_residual < lowest:
                best, lowest = place, squared_residual
    return lowest < inf, best


@kernel
def _at_elevation(wrench: Wrench, rim: Rim, angle: float, sign: float) -> tuple[bool, Place, float]:
    """One of the two radial directions that make F_theta zero at an elevation: whether it exists, the place,
    F_a."""
    f, m = wrench
    ring, r = rim
    ca, sa = cos(angle), sin(angle)
    px, py, along = m[1] - r * sa * f[0], -m[0] - r * sa * f[1], -(ring + r * ca) * f[2]
    pp = px * px + py * py
    disc = pp - along * along
    if not disc >= 0.0 or pp == 0.0:
        return False, Place(1.0, 0.0, ca, sa), 0.0
    root = sign * sqrt(disc)
    place = Place((along * px - root * py) / pp, (along * py + root * px) / pp, ca, sa)
    return True, place, _balance(wrench, rim, place).across


@kernel
def bisect_rim(wrench: Wrench, rim: Rim, low: float, high: float) -> tuple[bool, Place]:
    """The contact between two elevations of the rim, by bisection; however sharp it is.

    At each elevation F_theta = 0 is linear in the radial direction, with two solutions or none. Along
    either, F_a changes its sign at a contact.

    Args:
        wrench: Wrench, moment about the circle's centre.
        rim: The rim.
        low, high: Angles of elevation where the patch ends.

    Returns:
        Whether it is found, and its place.
    """
    for k in range(2 * _SEGMENTS):
        branch = 1.0 if k % 2 == 0 else -1.0
        a = low + (high - low) * (k // 2) / _SEGMENTS
        b = low + (high - low) * (k // 2 + 1) / _SEGMENTS
        at_a, _, first = _at_elevation(wrench, rim, a, branch)
        at_b, start, last = _at_elevation(wrench, rim, b, branch)
        if at_a != at_b:
            # Both solutions begin or end here, at the same direction.
            inside, outside = (a, b) if at_a else (b, a)
            for _ in range(_BISECTIONS):
                middle = 0.5 * (inside + outside)
                if _at_elevation(wrench, rim, middle, branch)[0]:
                    inside = middle
                else:
                    outside = middle
            end = _at_elevation(wrench, rim, inside, branch)[2]
            if at_a:
                b, last = inside, end
            else:
                a, first = inside, end
        if (at_a or at_b) and (first < 0.0) != (last < 0.0):
            for _ in range(_BISECTIONS):
                middle = 0.5 * (a + b)
                _, start, value = _at_elevation(wrench, rim, middle, branch)
                if (value < 0.0) == (first < 0.0):
                    a = middle
                else:
                    b = middle
            found, place, _ = refine_rim(wrench, rim, start)
            if found:
                return True, place
    return False, Place(1.0, 0.0, 1.0, 0.0)


@kernel
def search_rim(wrench: Wrench, rim: Rim) -> tuple[bool, Place]:
    """`refine_rim` from starts all around the rim, for the few wrenches whose first start fails."""
    for k in range(_STARTS_ACROSS):
        sa = (2.0 * k + 1.0) / _STARTS_ACROSS - 1.0
        started, start = start_rim(wrench, rim, sqrt(1.0 - sa * sa), sa)
        if started:
            found, place, _ = refine_rim(wrench, rim, start)
            if found:
                return True, place
    qc, qs = 1.0, 0.0
    for _ in range(_STARTS_AROUND):
        for k in range(_HEIGHTS):
            sa = (2.0 * k + 1.0) / _HEIGHTS - 1.0
            start, squared_residual = _elevation(wrench, rim, Place(qc, qs, sqrt(1.0 - sa * sa), sa))
            if squared_residual < inf:
                found, place, _ = refine_rim(wrench, rim, start)
                if found:
                    return True, place
        qc, qs = _rotate(qc, qs, 2.0 * pi / _STARTS_AROUND)
    return False, Place(1.0, 0.0, 1.0, 0.0)
