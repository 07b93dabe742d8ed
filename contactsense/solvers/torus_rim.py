"""Rounded rim: the outer half of a torus, the circle of radius `ring` about z plus a ball of radius r.

With the normal n = (cos a e, sin a), e the radial direction at the angle theta, the tangential moment has
the components

    F_theta = m_theta + ring f_z + r (cos a f_z - sin a f_rho)
    F_a     = cos a (m_z - ring f_theta) - sin a m_rho - r f_theta

Two equations in two angles, without a closed form (the polynomial has degree eight): Newton's method with
a line search, which has no local minima, because the Jacobian is regular wherever the force pushes
(theory, section 4). If only a part of the torus is a patch of a body, there is still at most one contact,
because the whole outer half belongs to a convex body, the disc plus the ball.
"""

from math import cos, inf, pi, sin, sqrt

from contactsense.solvers.solution import invariant, is_contact
from contactsense.solvers.typed_kernel import kernel

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
def _tangential_moment(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    ex: float,
    ey: float,
    ca: float,
    sa: float,
) -> tuple[float, float, float]:
    """Tangential moment F_theta, F_a and f.n."""
    f_rho, f_theta = ex * fx + ey * fy, ex * fy - ey * fx
    m_rho, m_theta = ex * mx + ey * my, ex * my - ey * mx
    around = m_theta + ring * fz + r * (ca * fz - sa * f_rho)
    across = ca * (mz - ring * f_theta) - sa * m_rho - r * f_theta
    return around, across, ca * f_rho + sa * fz


@kernel
def pushes_at(
    t: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    ex: float,
    ey: float,
    ca: float,
    sa: float,
) -> bool:
    """Whether a wrench with the invariant `t`, balanced at this place of the rim, pushes there."""
    f_rho, f_theta = ex * fx + ey * fy, ex * fy - ey * fx
    xi = ca * (ex * mx + ey * my) + sa * (mz - ring * f_theta)
    return is_contact(t, xi, ca * f_rho + sa * fz, max(ca, 0.0) / (r * (ring + r * ca)))


@kernel
def refine_rim(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    ex: float,
    ey: float,
    ca: float,
    sa: float,
) -> tuple[bool, float, float, float, float, int]:
    """Newton's method for the contact on a rim, from a start that is pushed at.

    Args:
        fx, fy, fz, mx, my, mz: Wrench, moment about the circle's centre.
        ring, r: Radii of the circle and of the ball.
        ex, ey, ca, sa: Start: radial direction, cosine and sine of the elevation.

    Returns:
        Whether a contact is found, radial direction, cosine and sine of the elevation (on the outer half of
        the torus), and the number of steps.
    """
    around, across, push = _tangential_moment(fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa)
    size = around * around + across * across
    step = 0
    ff = fx * fx + fy * fy + fz * fz
    t = invariant(fx, fy, fz, mx, my, mz)
    # Rounding error of the moment.
    floor = _FLOOR * (sqrt(mx * mx + my * my + mz * mz) + (ring + r) * sqrt(ff))
    for step in range(_STEPS):
        if size <= floor * floor:
            return pushes_at(t, fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa), ex, ey, ca, sa, step
        f_rho, f_theta = ex * fx + ey * fy, ex * fy - ey * fx
        m_rho, m_theta = ex * mx + ey * my, ex * my - ey * mx
        tt = -m_rho - r * sa * f_theta
        ta = -r * push
        at = -sa * m_theta + (ca * ring + r) * f_rho
        aa = -ca * m_rho - sa * (mz - ring * f_theta)
        det = tt * aa - ta * at
        if det == 0.0:
            return False, ex, ey, ca, sa, step
        d_theta = (ta * across - aa * around) / det
        d_a = (at * around - tt * across) / det
        share = 1.0
        better = False
        for _ in range(_HALVINGS):
            ux, uy = _rotate(ex, ey, share * d_theta)
            uc, us = _rotate(ca, sa, share * d_a)
            if uc < -_BEYOND:
                uc, us = 0.0, (1.0 if us > 0.0 else -1.0)
            new_around, new_across, new_push = _tangential_moment(
                fx, fy, fz, mx, my, mz, ring, r, ux, uy, uc, us
            )
            new_size = new_around * new_around + new_across * new_across
            if new_push < 0.0 and new_size < size:
                better = True
                break
            share *= 0.5
        if not better:
            break
        ex, ey, ca, sa = ux, uy, uc, us
        around, across, push, size = new_around, new_across, new_push, new_size
    # No decrease: the solution at the limit of rounding, else there is none on this rim.
    found = size <= 100.0 * floor * floor and pushes_at(t, fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa)
    return found, ex, ey, ca, sa, step


@kernel
def _elevation(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    ex: float,
    ey: float,
    ca: float,
    sa: float,
) -> tuple[float, float, float]:
    """The best of (ca, sa) and the elevations that make F_a or F_theta zero in the radial direction (ex, ey).

    Returns:
        Its cosine and sine, and |F|^2 there; infinite where none of them is pushed at.
    """
    around, across, push = _tangential_moment(fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa)
    lowest = around * around + across * across if push < 0.0 else inf
    f_rho, f_theta = ex * fx + ey * fy, ex * fy - ey * fx
    m_rho, m_theta = ex * mx + ey * my, ex * my - ey * mx
    # F_a = 0 is a c - b s = d with two solutions, F_theta = 0 one with a single pushing one.
    a, b, d = mz - ring * f_theta, m_rho, r * f_theta
    root = sqrt(max(a * a + b * b - d * d, 0.0))
    projection = -(m_theta + ring * fz) / r
    push_root = sqrt(max(f_rho * f_rho + fz * fz - projection * projection, 0.0))
    for k in range(3):
        if k == 0:
            tc, ts = d * a - root * b, -root * a - d * b
        elif k == 1:
            tc, ts = d * a + root * b, root * a - d * b
        else:
            tc, ts = projection * fz - push_root * f_rho, -projection * f_rho - push_root * fz
        size = sqrt(tc * tc + ts * ts)
        if tc >= 0.0 and size > 0.0:
            tc, ts = tc / size, ts / size
            around, across, push = _tangential_moment(fx, fy, fz, mx, my, mz, ring, r, ex, ey, tc, ts)
            squared_residual = around * around + across * across
            if push < 0.0 and squared_residual < lowest:
                ca, sa, lowest = tc, ts, squared_residual
    return ca, sa, lowest


@kernel
def start_rim(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    ca: float,
    sa: float,
) -> tuple[bool, float, float, float, float]:
    """A start for `refine_rim`: one equation exact around the axis at the elevation (ca, sa), one across.

    At a given elevation both equations are linear in the direction, as on a cylinder and on a cone.
    """
    rho, z, q = ring + r * ca, r * sa, ring * ca + r
    best_x = best_y = best_c = best_s = 0.0
    lowest = inf
    for k in range(4):
        if k < 2:
            px, py, along = my - z * fx, -mx - z * fy, -rho * fz
        else:
            px, py, along = -sa * mx - q * fy, q * fx - sa * my, -ca * mz
        root = sqrt(max(px * px + py * py - along * along, 0.0))
        if k % 2 == 0:
            root = -root
        ex, ey = along * px - root * py, along * py + root * px
        size = sqrt(ex * ex + ey * ey)
        if size > 0.0:
            ex, ey = ex / size, ey / size
            tc, ts, squared_residual = _elevation(fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa)
            if squared_residual < lowest:
                best_x, best_y, best_c, best_s, lowest = ex, ey, tc, ts, squared_residual
    return lowest < inf, best_x, best_y, best_c, best_s


@kernel
def _at_elevation(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    angle: float,
    sign: float,
) -> tuple[bool, float, float, float, float, float]:
    """One of the two radial directions that make F_theta zero at an elevation: whether it exists, direction,
    cosine and sine of the elevation, F_a."""
    ca, sa = cos(angle), sin(angle)
    px, py, along = my - r * sa * fx, -mx - r * sa * fy, -(ring + r * ca) * fz
    pp = px * px + py * py
    disc = pp - along * along
    if not disc >= 0.0 or pp == 0.0:
        return False, 1.0, 0.0, ca, sa, 0.0
    root = sign * sqrt(disc)
    ex, ey = (along * px - root * py) / pp, (along * py + root * px) / pp
    f_theta = ex * fy - ey * fx
    across = ca * (mz - ring * f_theta) - sa * (ex * mx + ey * my) - r * f_theta
    return True, ex, ey, ca, sa, across


@kernel
def bisect_rim(
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    ring: float,
    r: float,
    low: float,
    high: float,
) -> tuple[bool, float, float, float, float]:
    """The contact between two elevations of the rim, by bisection; however sharp it is.

    At each elevation F_theta = 0 is linear in the radial direction, with two solutions or none. Along
    either, F_a changes its sign at a contact.

    Args:
        fx, fy, fz, mx, my, mz: Wrench, moment about the circle's centre.
        ring, r: Radii of the circle and of the ball.
        low, high: Angles of elevation where the patch ends.

    Returns:
        Whether it is found, radial direction, cosine and sine of the elevation.
    """
    for k in range(2 * _SEGMENTS):
        branch = 1.0 if k % 2 == 0 else -1.0
        a = low + (high - low) * (k // 2) / _SEGMENTS
        b = low + (high - low) * (k // 2 + 1) / _SEGMENTS
        at_a, _, _, _, _, first = _at_elevation(fx, fy, fz, mx, my, mz, ring, r, a, branch)
        at_b, ex, ey, ca, sa, last = _at_elevation(fx, fy, fz, mx, my, mz, ring, r, b, branch)
        if at_a != at_b:
            # Both solutions begin or end here, at the same direction.
            inside, outside = (a, b) if at_a else (b, a)
            for _ in range(_BISECTIONS):
                middle = 0.5 * (inside + outside)
                if _at_elevation(fx, fy, fz, mx, my, mz, ring, r, middle, branch)[0]:
                    inside = middle
                else:
                    outside = middle
            end = _at_elevation(fx, fy, fz, mx, my, mz, ring, r, inside, branch)[5]
            if at_a:
                b, last = inside, end
            else:
                a, first = inside, end
        if (at_a or at_b) and (first < 0.0) != (last < 0.0):
            for _ in range(_BISECTIONS):
                middle = 0.5 * (a + b)
                _, ex, ey, ca, sa, value = _at_elevation(fx, fy, fz, mx, my, mz, ring, r, middle, branch)
                if (value < 0.0) == (first < 0.0):
                    a = middle
                else:
                    b = middle
            found, px, py, pc, ps, _ = refine_rim(fx, fy, fz, mx, my, mz, ring, r, ex, ey, ca, sa)
            if found:
                return True, px, py, pc, ps
    return False, 1.0, 0.0, 1.0, 0.0


@kernel
def search_rim(
    fx: float, fy: float, fz: float, mx: float, my: float, mz: float, ring: float, r: float
) -> tuple[bool, float, float, float, float]:
    """`refine_rim` from starts all around the rim, for the few wrenches whose first start fails."""
    for k in range(_STARTS_ACROSS):
        sa = (2.0 * k + 1.0) / _STARTS_ACROSS - 1.0
        ca = sqrt(1.0 - sa * sa)
        started, ex, ey, uc, us = start_rim(fx, fy, fz, mx, my, mz, ring, r, ca, sa)
        if started:
            found, ex, ey, uc, us, _ = refine_rim(fx, fy, fz, mx, my, mz, ring, r, ex, ey, uc, us)
            if found:
                return True, ex, ey, uc, us
    qc, qs = 1.0, 0.0
    for _ in range(_STARTS_AROUND):
        for k in range(_HEIGHTS):
            sa = (2.0 * k + 1.0) / _HEIGHTS - 1.0
            ca, sa, squared_residual = _elevation(
                fx, fy, fz, mx, my, mz, ring, r, qc, qs, sqrt(1.0 - sa * sa), sa
            )
            if squared_residual < inf:
                found, ex, ey, uc, us, _ = refine_rim(fx, fy, fz, mx, my, mz, ring, r, qc, qs, ca, sa)
                if found:
                    return True, ex, ey, uc, us
        qc, qs = _rotate(qc, qs, 2.0 * pi / _STARTS_AROUND)
    return False, 1.0, 0.0, 1.0, 0.0
