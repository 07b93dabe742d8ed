"""Most probable places and forces of several simultaneous contacts, by Gauss-Newton on all of them together.

The energy is that of `contactsense.energy`, with one measurement for all contacts:

    E = 1/2 |y - sum_i A_i w_i|^2  +  sum_i [ priors of force, lean, torsion and surface offset of contact i ]

y being the rows of `contactsense.several.rows`, A_i what they see of the link of contact i, w_i = (f, (c + h
n) x f + xi n). The unknowns of a contact are the logarithm of its normal force F, lean f_t / F and torsion xi
/ F, the offset h of the real surface from the primitive, each in units of its prior, and a step of its place
c in the tangent plane. In these the priors are unit normal distributions (that of the lean Student's), so
that what no sensor sees stays what it was beforehand. A contact that is tracked already has a prior of its
place too, and may have one of its force.
"""

import math

from contactsense.energy import TAIL, tangents
from contactsense.several.cholesky import solve_in_place
from contactsense.several.memory import UNKNOWNS
from robots.compiled import fused_kernel
from robots.surface import curvature, project

ITERATIONS = 20
"""Most Gauss-Newton steps."""
TRIALS = 5
"""Most lengths that are tried for one step before the search ends."""
SHORT = 0.25
"""A step that had to be shortened to less than this part tells that its direction is no good."""
SOFTEST, STIFFEST = 0.1, 10.0
"""Range of damping: by this part the diagonal of the equations is made larger."""
ENOUGH = 1e-3
"""A step that promises or brings less gain than this ends the search. In bent valleys what is left may be
fifty times as much: a twentieth, which is nothing beside noise."""
LONGEST = 1.5
"""Longest step in the logarithm of a force."""
PATCH = 0.6
"""Standard deviation of a place on a primitive before any measurement, in parts of the bounding radius: that
of a point anywhere on a rod. It bounds the covariance of what cannot be resolved."""
HASTE = 3.0
"""How many times the gain that a step promises is hoped for before a search above the limit is given up."""


@fused_kernel
def settle(surfaces, bodies, rows, m, prior, count, limit, stack):  # type: ignore[no-untyped-def]
    """Search from the contacts in `stack` and leave the most probable ones there.

    Args:
        surfaces: Primitives.
        bodies: Where all primitives are, base frame.
        rows, m: The measurement and the number of its rows.
        prior: What is known of contacts beforehand.
        count: Number of contacts.
        limit: Energy above which they are of no interest; the search ends once it is sure to stay there.
        stack: First guess, pushing; on return the result, with the factor of its information in `matrix`.

    Returns:
        energy, and log evidence (Laplace) up to the noise's own constant. Infinite energy where it stays
        above the limit or where the matrix is not positive.
    """
    size = count * UNKNOWNS
    H, g = stack.matrix, stack.step
    energy = _energy(surfaces.link, rows, m, prior, count, stack)
    log_det = math.inf
    damping = 0.0
    for iteration in range(ITERATIONS + 1):
        _linearize(surfaces, bodies, rows, m, prior, count, stack)
        for i in range(size):
            H[i, i] *= 1.0 + damping
        log_det, hope = solve_in_place(H, g, size)
        _keep(count, stack, True)
        if log_det == math.inf or iteration == ITERATIONS:
            break
        if damping == 0.0 and (hope < ENOUGH or energy - HASTE * hope > limit):
            break
        whole = 1.0
        for i in range(count):
            whole = min(whole, LONGEST / max(abs(g[i * UNKNOWNS]), 1e-9))
        scale = whole
        gained = 0.0
        for _ in range(TRIALS):
            _step(surfaces, bodies, prior, count, scale, stack)
            tried = _energy(surfaces.link, rows, m, prior, count, stack)
            if tried < energy:
                gained = energy - tried
                energy = tried
                break
            # Least place of the parabola through both energies and the slope between them.
            scale *= min(max(hope * scale / (tried - energy + 2.0 * hope * scale), 0.1), 0.5)
        if gained == 0.0:
            _keep(count, stack, False)
        if gained >= ENOUGH:
            damping = 0.0
        elif (damping == 0.0 and gained > 0.0 and scale > SHORT * whole) or damping >= STIFFEST:
            break
        else:
            # The step goes where the energy is not what its derivatives say, across a kink in the curvature:
            # the next one is shorter where they say least.
            damping = max(10.0 * damping, SOFTEST)
    if damping > 0.0:
        _linearize(surfaces, bodies, rows, m, prior, count, stack)
        log_det, _ = solve_in_place(H, g, size)
    if log_det == math.inf or energy > limit:
        return math.inf, -math.inf
    return energy, count * math.log(2.0 * math.pi / prior.area) - energy - 0.5 * log_det


@fused_kernel
def put(surfaces, bodies, stack, i, p, x, y, z, fx, fy, fz):  # type: ignore[no-untyped-def]
    """Set contact i: on primitive p nearest to a point (base frame), with a force (base axes) that pushes."""
    R, o, c, T = bodies.rotation[p], bodies.origin[p], stack.point[i], stack.frame[i]
    x, y, z = x - o[0], y - o[1], z - o[2]
    _, bx, by, bz, n1, n2, n3 = project(
        surfaces.kind[p],
        surfaces.size[p],
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )
    for k in range(3):
        c[k] = o[k] + R[k, 0] * bx + R[k, 1] * by + R[k, 2] * bz
        T[k, 0] = R[k, 0] * n1 + R[k, 1] * n2 + R[k, 2] * n3
    T[0, 1], T[1, 1], T[2, 1], T[0, 2], T[1, 2], T[2, 2] = tangents(T[0, 0], T[1, 0], T[2, 0])
    stack.primitive[i] = p
    stack.force[i, 0], stack.force[i, 1], stack.force[i, 2] = fx, fy, fz
    stack.torsion[i], stack.offset[i] = 0.0, 0.0


@fused_kernel
def _keep(count, stack, away):  # type: ignore[no-untyped-def]
    """Put the contacts aside, or take them back."""
    for i in range(count):
        for k in range(3):
            if away:
                stack.kept_point[i, k], stack.kept_force[i, k] = stack.point[i, k], stack.force[i, k]
            else:
                stack.point[i, k], stack.force[i, k] = stack.kept_point[i, k], stack.kept_force[i, k]
            for a in range(3):
                if away:
                    stack.kept_frame[i, k, a] = stack.frame[i, k, a]
                else:
                    stack.frame[i, k, a] = stack.kept_frame[i, k, a]
        if away:
            stack.kept_torsion[i], stack.kept_offset[i] = stack.torsion[i], stack.offset[i]
        else:
            stack.torsion[i], stack.offset[i] = stack.kept_torsion[i], stack.kept_offset[i]


@fused_kernel
def _along(T, a, f):  # type: ignore[no-untyped-def]
    """Component of f along column a of a frame."""
    return T[0, a] * f[0] + T[1, a] * f[1] + T[2, a] * f[2]


@fused_kernel
def _energy(links, rows, m, prior, count, stack):  # type: ignore[no-untyped-def]
    """Energy of the contacts in `stack`; leaves the residual and each contact's wrench."""
    y = stack.residual
    for r in range(m):
        y[r] = rows.value[r]
    energy = 0.0
    for i in range(count):
        c, T, f, w = stack.point[i], stack.frame[i], stack.force[i], stack.wrench[i]
        xi, h = stack.torsion[i], stack.offset[i]
        F = -_along(T, 0, f)
        if F <= 0.0:
            return math.inf
        size = math.log(F / prior.force)
        twist = xi / (prior.lever * F)
        lean = (_along(T, 1, f) ** 2 + _along(T, 2, f) ** 2) / (prior.lean * F) ** 2
        cost = twist * twist + size * size + (TAIL + 2.0) * math.log(1.0 + lean / TAIL)
        cost += (h / prior.offset) ** 2
        for k in range(3):
            S = stack.prior_sharpness[i, k]
            away = (
                S[0] * (c[0] - stack.prior_point[i, 0])
                + S[1] * (c[1] - stack.prior_point[i, 1])
                + S[2] * (c[2] - stack.prior_point[i, 2])
            )
            cost += away * (c[k] - stack.prior_point[i, k])
            cost += stack.prior_stiffness[i] * (f[k] - stack.prior_force[i, k]) ** 2
        energy += 0.5 * cost
        px, py, pz = c[0] + h * T[0, 0], c[1] + h * T[1, 0], c[2] + h * T[2, 0]
        w[0], w[1], w[2] = f[0], f[1], f[2]
        w[3] = py * f[2] - pz * f[1] + xi * T[0, 0]
        w[4] = pz * f[0] - px * f[2] + xi * T[1, 0]
        w[5] = px * f[1] - py * f[0] + xi * T[2, 0]
        A = rows.matrix[links[stack.primitive[i]]]
        for r in range(m):
            a = A[r]
            y[r] -= a[0] * w[0] + a[1] * w[1] + a[2] * w[2] + a[3] * w[3] + a[4] * w[4] + a[5] * w[5]
    for r in range(m):
        energy += 0.5 * y[r] * y[r]
    return energy


@fused_kernel
def _bend(surfaces, bodies, stack, i):  # type: ignore[no-untyped-def]
    """Curvature along the two tangents at contact i: k11, k12, k22 [1/m]."""
    p = stack.primitive[i]
    R, o, c, T = bodies.rotation[p], bodies.origin[p], stack.point[i], stack.frame[i]
    b = stack.body
    for k in range(3):
        x = 0.0
        for a in range(3):
            x += R[a, k] * (c[a] - o[a])
        b[k, 3] = x
        for column in range(3):
            x = 0.0
            for a in range(3):
                x += R[a, k] * T[a, column]
            b[k, column] = x
    xx, xy, xz, yy, yz, zz = curvature(
        surfaces.kind[p], surfaces.size[p], b[0, 3], b[1, 3], b[2, 3], b[0, 0], b[1, 0], b[2, 0]
    )
    u1 = xx * b[0, 1] + xy * b[1, 1] + xz * b[2, 1]
    u2 = xy * b[0, 1] + yy * b[1, 1] + yz * b[2, 1]
    u3 = xz * b[0, 1] + yz * b[1, 1] + zz * b[2, 1]
    v1 = xx * b[0, 2] + xy * b[1, 2] + xz * b[2, 2]
    v2 = xy * b[0, 2] + yy * b[1, 2] + yz * b[2, 2]
    v3 = xz * b[0, 2] + yz * b[1, 2] + zz * b[2, 2]
    return (
        b[0, 1] * u1 + b[1, 1] * u2 + b[2, 1] * u3,
        b[0, 2] * u1 + b[1, 2] * u2 + b[2, 2] * u3,
        b[0, 2] * v1 + b[1, 2] * v2 + b[2, 2] * v3,
    )


@fused_kernel
def _add(H, g, at, residual, row):  # type: ignore[no-untyped-def]
    """Add a squared residual with its derivatives by one contact's unknowns to H (lower triangle) and g."""
    for a in range(UNKNOWNS):
        g[at + a] += residual * row[a]
        for b in range(a + 1):
            H[at + a, at + b] += row[a] * row[b]


@fused_kernel
def _linearize(surfaces, bodies, rows, m, prior, count, stack):  # type: ignore[no-untyped-def]
    """Gauss-Newton matrix (lower triangle) and gradient at the contacts in `stack`, whose energy was the last
    computed."""
    size = count * UNKNOWNS
    H, g, J, G = stack.matrix, stack.step, stack.jacobian, stack.wrench_map
    _energy(surfaces.link, rows, m, prior, count, stack)
    H[:size, :size] = 0.0
    g[:size] = 0.0
    for i in range(count):
        at = i * UNKNOWNS
        p = stack.primitive[i]
        c, T, f, w = stack.point[i], stack.frame[i], stack.force[i], stack.wrench[i]
        xi, h = stack.torsion[i], stack.offset[i]
        k11, k12, k22 = _bend(surfaces, bodies, stack, i)
        F = -_along(T, 0, f)
        alpha, beta = _along(T, 1, f) / F, _along(T, 2, f) / F
        # With force and torsion held, a step turns the normal: the same force leans more, and pushes less.
        s1, s2 = -(alpha * k11 + beta * k12), -(alpha * k12 + beta * k22)
        _add(H, g, at, math.log(F / prior.force), (1.0, 0.0, 0.0, 0.0, s1, s2, 0.0))
        x = xi / (prior.lever * F)
        _add(H, g, at, x, (0.0, 0.0, 0.0, 1.0, -x * s1, -x * s2, 0.0))
        # The heavy tail's weight: what a quadratic would have to be multiplied by to have the same slope.
        i_lean = 1.0 / prior.lean
        weight = math.sqrt((TAIL + 2.0) / (TAIL + (alpha * alpha + beta * beta) * i_lean * i_lean))
        e = weight * i_lean
        row = (0.0, weight, 0.0, 0.0, e * (k11 - alpha * s1), e * (k12 - alpha * s2), 0.0)
        _add(H, g, at, e * alpha, row)
        row = (0.0, 0.0, weight, 0.0, e * (k12 - beta * s1), e * (k22 - beta * s2), 0.0)
        _add(H, g, at, e * beta, row)
        _add(H, g, at, h / prior.offset, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        px, py, pz = c[0] + h * T[0, 0], c[1] + h * T[1, 0], c[2] + h * T[2, 0]
        for k in range(6):
            G[k, at] = w[k]
        for a in range(1, 3):
            x = prior.lean * F
            fx, fy, fz = x * T[0, a], x * T[1, a], x * T[2, a]
            G[0, at + a], G[1, at + a], G[2, at + a] = fx, fy, fz
            G[3, at + a], G[4, at + a], G[5, at + a] = py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx
        for a in range(3, UNKNOWNS):
            G[0, at + a], G[1, at + a], G[2, at + a] = 0.0, 0.0, 0.0
        for k in range(3):
            G[3 + k, at + 3] = prior.lever * F * T[k, 0]
            # How the normal turns with a step along each tangent turns the torsion.
            G[3 + k, at + 4] = xi * (k11 * T[k, 1] + k12 * T[k, 2])
            G[3 + k, at + 5] = xi * (k12 * T[k, 1] + k22 * T[k, 2])
        for a in range(3):
            # The place moves along a tangent, and the offset's direction turns; last, along the normal.
            e0 = 0.0 if a < 2 else prior.offset
            e1 = (1.0 + h * k11) if a == 0 else (h * k12 if a == 1 else 0.0)
            e2 = h * k12 if a == 0 else ((1.0 + h * k22) if a == 1 else 0.0)
            tx = e0 * T[0, 0] + e1 * T[0, 1] + e2 * T[0, 2]
            ty = e0 * T[1, 0] + e1 * T[1, 1] + e2 * T[1, 2]
            tz = e0 * T[2, 0] + e1 * T[2, 1] + e2 * T[2, 2]
            if a == 2:
                G[3, at + 6], G[4, at + 6], G[5, at + 6] = 0.0, 0.0, 0.0
            G[3, at + 4 + a] += ty * f[2] - tz * f[1]
            G[4, at + 4 + a] += tz * f[0] - tx * f[2]
            G[5, at + 4 + a] += tx * f[1] - ty * f[0]
        _add_known(surfaces.radius[p], stack, i)
        B = rows.matrix[surfaces.link[p]]
        for r in range(m):
            A = B[r]
            for a in range(at, at + UNKNOWNS):
                J[r, a] = (
                    A[0] * G[0, a]
                    + A[1] * G[1, a]
                    + A[2] * G[2, a]
                    + A[3] * G[3, a]
                    + A[4] * G[4, a]
                    + A[5] * G[5, a]
                )
    for r in range(m):
        for a in range(size):
            x = J[r, a]
            g[a] -= x * stack.residual[r]
            for b in range(a + 1):
                H[a, b] += x * J[r, b]


@fused_kernel
def _add_known(radius, stack, i):  # type: ignore[no-untyped-def]
    """Priors of place and force of contact i, and the extent of its primitive."""
    at = i * UNKNOWNS
    H, g, G = stack.matrix, stack.step, stack.wrench_map
    S, T, c, c0 = stack.prior_sharpness[i], stack.frame[i], stack.point[i], stack.prior_point[i]
    patch = 1.0 / (PATCH * radius) ** 2
    for a in range(2):
        for k in range(3):
            st = S[k, 0] * T[0, a + 1] + S[k, 1] * T[1, a + 1] + S[k, 2] * T[2, a + 1]
            g[at + 4 + a] += st * (c[k] - c0[k])
            for b in range(a + 1):
                H[at + 4 + a, at + 4 + b] += st * T[k, b + 1]
        H[at + 4 + a, at + 4 + a] += patch
    stiff = stack.prior_stiffness[i]
    if stiff > 0.0:
        for k in range(3):
            d = stack.force[i, k] - stack.prior_force[i, k]
            for a in range(3):
                g[at + a] += stiff * d * G[k, at + a]
                for b in range(a + 1):
                    H[at + a, at + b] += stiff * G[k, at + a] * G[k, at + b]


@fused_kernel
def _step(surfaces, bodies, prior, count, scale, stack):  # type: ignore[no-untyped-def]
    """Take the step, times `scale`, from the contacts that were put aside."""
    for i in range(count):
        at = i * UNKNOWNS
        d, T = stack.step, stack.kept_frame[i]
        f, c = stack.kept_force[i], stack.kept_point[i]
        F = -_along(T, 0, f)
        alpha = _along(T, 1, f) / F - scale * d[at + 1] * prior.lean
        beta = _along(T, 2, f) / F - scale * d[at + 2] * prior.lean
        twist = stack.kept_torsion[i] / F - scale * d[at + 3] * prior.lever
        offset = stack.kept_offset[i] - scale * d[at + 6] * prior.offset
        F *= math.exp(-scale * d[at])
        v1, v2 = -scale * d[at + 4], -scale * d[at + 5]
        put(
            surfaces,
            bodies,
            stack,
            i,
            stack.primitive[i],
            c[0] + v1 * T[0, 1] + v2 * T[0, 2],
            c[1] + v1 * T[1, 1] + v2 * T[1, 2],
            c[2] + v1 * T[2, 1] + v2 * T[2, 2],
            F * (alpha * T[0, 1] + beta * T[0, 2] - T[0, 0]),
            F * (alpha * T[1, 1] + beta * T[1, 2] - T[1, 0]),
            F * (alpha * T[2, 1] + beta * T[2, 2] - T[2, 0]),
        )
        stack.torsion[i] = F * twist
        stack.offset[i] = offset
