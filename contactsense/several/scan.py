"""Where to start: which sampled places, together with contacts that are known, could explain a measurement.

A contact near a place with an unknown push and some lean makes the rows a Gaussian vector, whose covariance
it widens by S = C Q C^T (C: rows by force there, Q: covariance of the force) plus what the distance between
samples adds. The covariances of several contacts add up, so the likelihood of any set of places is that of
one small Gaussian.
"""

import math

from contactsense.several.cholesky import factor
from robots.compiled import fused_kernel

LEAN = 2.0
"""Scale of the lean in the scan over that of the prior, for its heavy tail."""
LEVER = 0.5
"""Lever arm by which a torque tells of a force when there is no base sensor [m]."""
SIDE = 0.9
"""Cosine between normals above which two places are on one side of a primitive."""
FAINT = 1.0
"""Force that is reckoned with at least [N]."""


@fused_kernel
def likely_force(parts, present):  # type: ignore[no-untyped-def]
    """Size of the forces at work, about [N]; arguments as for `contactsense.several.rows.fill_rows`."""
    force = FAINT
    if present[0]:
        y = parts[0]
        force = max(force, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    if present[2]:
        y = parts[2]
        force = max(force, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    if present[1]:
        for j in range(parts[1].shape[0]):
            force = max(force, abs(parts[1][j]) / LEVER)
    return force


@fused_kernel
def _widen(rows, m, link, place, force, slack, levers, entering, out):  # type: ignore[no-untyped-def]
    """Add to `out` (lower triangle) the covariance of the rows by a contact.

    Args:
        rows, m, link: The measurement, the number of its rows, the touched link.
        place: Point and normal, base frame, six floats.
        force: Standard deviation of the force along the normal, and across it [N].
        slack: Standard deviation of each component of the moment besides [Nm].
        levers: Scratch: each row by force, shape (M, 3).
        entering: Filled: each row by a unit force along the normal, shape (M,).
        out: Shape (M, M).
    """
    A, seen = rows.matrix[link], rows.seen[link]
    cx, cy, cz, nx, ny, nz = place
    across = force[1] * force[1]
    along = force[0] * force[0] - across
    loose = slack * slack
    for r in range(m):
        entering[r] = 0.0
        if seen[r] == 0.0:
            continue
        a, b = A[r], levers[r]
        # a . (f, c x f) = (a_f + a_m x c) . f
        b[0] = a[0] + a[4] * cz - a[5] * cy
        b[1] = a[1] + a[5] * cx - a[3] * cz
        b[2] = a[2] + a[3] * cy - a[4] * cx
        e = b[0] * nx + b[1] * ny + b[2] * nz
        entering[r] = e
        for s in range(r + 1):
            if seen[s] == 0.0:
                continue
            d, v = levers[s], A[s]
            out[r, s] += (
                across * (b[0] * d[0] + b[1] * d[1] + b[2] * d[2])
                + along * e * entering[s]
                + loose * (a[3] * v[3] + a[4] * v[4] + a[5] * v[5])
            )


@fused_kernel
def _fit(m, scan):  # type: ignore[no-untyped-def]
    """Log likelihood of the innovation under the covariance in `scan.factor`, but for a constant; solves half
    the way."""
    L, y, z = scan.factor, scan.innovation, scan.weighed
    log_det = factor(L, m)
    fit = -0.5 * log_det
    for r in range(m):
        x = y[r]
        for s in range(r):
            x -= L[r, s] * z[s]
        z[r] = x / L[r, r]
        fit -= 0.5 * z[r] * z[r]
    return fit


@fused_kernel
def _weigh(m, scan):  # type: ignore[no-untyped-def]
    """The other half of the way after `_fit`: `weighed` = inverse covariance times innovation."""
    L, z = scan.factor, scan.weighed
    for r in range(m - 1, -1, -1):
        x = z[r]
        for s in range(r + 1, m):
            x -= L[s, r] * z[s]
        z[r] = x / L[r, r]


@fused_kernel
def _pushes(m, scan, place):  # type: ignore[no-untyped-def]
    """Whether the most likely force at a place pushes, after `_weigh`."""
    x = 0.0
    for r in range(m):
        x += scan.entering[place, r] * scan.weighed[r]
    return x < 0.0


@fused_kernel
def _alike(primitives, place, a, b):  # type: ignore[no-untyped-def]
    """Whether the search goes from one place to the other by itself: on one primitive, one side of it."""
    u, v = place[a], place[b]
    return primitives[a] == primitives[b] and u[3] * v[3] + u[4] * v[4] + u[5] * v[5] > SIDE


@fused_kernel
def offer_seed(primitives, place, count, score, a, b, c, scores, seeds):  # type: ignore[no-untyped-def]
    """Put a set of `count` places into a list sorted by falling score, if it is good enough.

    Of sets that differ in one place only, on the same side of the same primitive, the list keeps the best.
    """
    last = scores.shape[0] - 1
    if not score > scores[last]:
        return
    rival = last
    for i in range(last + 1):
        if scores[i] == -math.inf:
            break
        x, y, z = seeds[i, 0], seeds[i, 1], seeds[i, 2]
        same = _alike(primitives, place, x, a)
        differ = 1 if x != a else 0
        if count > 1:
            same = same and _alike(primitives, place, y, b)
            differ += 1 if y != b else 0
        if count > 2:
            same = same and _alike(primitives, place, z, c)
            differ += 1 if z != c else 0
        if same and differ <= 1:
            if scores[i] >= score:
                return
            rival = i
            break
    at = rival
    while at > 0 and scores[at - 1] < score:
        scores[at] = scores[at - 1]
        seeds[at, 0], seeds[at, 1], seeds[at, 2] = seeds[at - 1, 0], seeds[at - 1, 1], seeds[at - 1, 2]
        at -= 1
    scores[at] = score
    seeds[at, 0], seeds[at, 1], seeds[at, 2] = a, b, c


@fused_kernel
def place_places(places, depth, motion, choice, scan):  # type: ignore[no-untyped-def]
    """Bring all places to the base frame: fills `scan.place`."""
    for i in range(choice.link.shape[0]):
        body = depth[choice.link[i]]
        R, o, c, n = motion.rotation[body], motion.origin[body], places.point[i], places.normal[i]
        out = scan.place[i]
        for k in range(3):
            out[k] = o[k] + R[k, 0] * c[0] + R[k, 1] * c[1] + R[k, 2] * c[2]
            out[3 + k] = R[k, 0] * n[0] + R[k, 1] * n[1] + R[k, 2] * n[2]


@fused_kernel
def lay_ground(links, lean, known, count, force, rows, m, scan):  # type: ignore[no-untyped-def]
    """Covariance of the rows by noise and by `count` known contacts, and the innovation over their known
    forces.

    `links`: link of each primitive; `lean`: scale of the prior's; `force`: about the size of the forces at
    work [N]. The normals of the known contacts are in `scan.normals`.
    """
    scan.ground[:m, :m] = 0.0
    for r in range(m):
        scan.ground[r, r] = 1.0
        scan.innovation[r] = rows.value[r]
    for i in range(count):
        link = links[known.primitive[i]]
        c, n, f, C = known.point[i], scan.normals[i], known.force[i], known.covariance[i]
        across, along, size = LEAN * lean * force, force, force
        if known.drift[i] < math.inf:
            across = along = known.drift[i]
            size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
            w = (
                f[0],
                f[1],
                f[2],
                c[1] * f[2] - c[2] * f[1],
                c[2] * f[0] - c[0] * f[2],
                c[0] * f[1] - c[1] * f[0],
            )
            for r in range(m):
                for k in range(6):
                    scan.innovation[r] -= rows.matrix[link, r, k] * w[k]
        slack = size * math.sqrt(0.5 * (C[0, 0] + C[1, 1] + C[2, 2]))
        place = (c[0], c[1], c[2], n[0], n[1], n[2])
        _widen(rows, m, link, place, (along, across), slack, scan.levers, scan.weighed, scan.ground)


@fused_kernel
def _widen_at(choice, lean, i, coarser, force, rows, m, scan, out):  # type: ignore[no-untyped-def]
    """`_widen` by a contact at place i."""
    c = scan.place[i]
    place = (c[0], c[1], c[2], c[3], c[4], c[5])
    slack = choice.spread[i] * coarser * force
    sizes = (force, LEAN * lean * force)
    _widen(rows, m, choice.link[i], place, sizes, slack, scan.levers, scan.entering[i], out)


@fused_kernel
def scan_places(choice, lean, extra, force, rows, m, scan):  # type: ignore[no-untyped-def]
    """Fill `scan.seed` with sets of `extra` (1 to 3) places that explain the innovation best; how many.

    Args:
        choice: Which places are tried.
        lean: Scale of the prior's lean.
        extra: Number of contacts that are sought.
        force: Size of the forces at work, about [N].
        rows, m: The measurement and the number of its rows.
        scan: After `place_places` and `lay_ground`.
    """
    scan.seed_score[:] = -math.inf
    if extra == 1:
        _scan_all(choice, lean, force, rows, m, scan)
    else:
        _scan_pairs(choice, lean, extra, force, rows, m, scan)
    if extra == 3:
        _scan_thirds(choice, m, scan)
    count = 0
    while count < scan.seed_score.shape[0] and scan.seed_score[count] > -math.inf:
        count += 1
    return count


@fused_kernel
def _scan_all(choice, lean, force, rows, m, scan):  # type: ignore[no-untyped-def]
    """Every place for one further contact."""
    for i in range(choice.primitive.shape[0]):
        _copy(m, scan.ground, scan.factor)
        _widen_at(choice, lean, i, 1.0, force, rows, m, scan, scan.factor)
        fit = _fit(m, scan)
        if fit > scan.seed_score[-1]:
            _weigh(m, scan)
            if _pushes(m, scan, i):
                offer_seed(choice.primitive, scan.place, 1, fit, i, 0, 0, scan.seed_score, scan.seed)


@fused_kernel
def _scan_pairs(choice, lean, extra, force, rows, m, scan):  # type: ignore[no-untyped-def]
    """Every pair of the few places: as seeds for two, as a beam for three."""
    scan.beam_score[:] = -math.inf
    for e in range(choice.few.shape[0]):
        i, S = choice.few[e], scan.spread[e]
        for r in range(m):
            for s in range(r + 1):
                S[r, s] = 0.0
        _widen_at(choice, lean, i, choice.coarser, force, rows, m, scan, S)
        _sum(m, scan.ground, S, scan.pair)
        for d in range(e):
            k = choice.few[d]
            _sum(m, scan.pair, scan.spread[d], scan.factor)
            fit = _fit(m, scan)
            if extra > 2:
                offer_seed(choice.primitive, scan.place, 2, fit, i, k, 0, scan.beam_score, scan.beam)
            elif fit > scan.seed_score[-1]:
                _weigh(m, scan)
                if _pushes(m, scan, i) and _pushes(m, scan, k):
                    offer_seed(choice.primitive, scan.place, 2, fit, i, k, 0, scan.seed_score, scan.seed)


@fused_kernel
def _scan_thirds(choice, m, scan):  # type: ignore[no-untyped-def]
    """The pairs of the beam with each of the few places."""
    for t in range(scan.beam_score.shape[0]):
        if scan.beam_score[t] == -math.inf:
            break
        i, k = scan.beam[t, 0], scan.beam[t, 1]
        _copy(m, scan.ground, scan.pair)
        for e in range(choice.few.shape[0]):
            if choice.few[e] == i or choice.few[e] == k:
                _sum(m, scan.pair, scan.spread[e], scan.pair)
        for e in range(choice.few.shape[0]):
            j = choice.few[e]
            if j == i or j == k:  # noqa: SIM109 (a tuple would be searched slower)
                continue
            _sum(m, scan.pair, scan.spread[e], scan.factor)
            fit = _fit(m, scan)
            if fit > scan.seed_score[-1]:
                _weigh(m, scan)
                if _pushes(m, scan, i) and _pushes(m, scan, k) and _pushes(m, scan, j):
                    # In a fixed order, so that the same three are one seed.
                    a, c = max(i, max(k, j)), min(i, min(k, j))
                    b = i + k + j - a - c
                    offer_seed(choice.primitive, scan.place, 3, fit, a, b, c, scan.seed_score, scan.seed)


@fused_kernel
def _copy(m, a, out):  # type: ignore[no-untyped-def]
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s]


@fused_kernel
def _sum(m, a, b, out):  # type: ignore[no-untyped-def]
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s] + b[r, s]


@fused_kernel
def likely_pushes(choice, lean, t, extra, force, rows, m, scan, out):  # type: ignore[no-untyped-def]
    """Most likely forces at the places of a seed, base axes, shape (>= extra, 3) [N]."""
    coarser = 1.0 if extra == 1 else choice.coarser
    _copy(m, scan.ground, scan.factor)
    for e in range(extra):
        _widen_at(choice, lean, scan.seed[t, e], coarser, force, rows, m, scan, scan.factor)
    _fit(m, scan)
    _weigh(m, scan)
    across = (LEAN * lean * force) ** 2
    for e in range(extra):
        i = scan.seed[t, e]
        link = choice.link[i]
        c = scan.place[i]
        c0, c1, c2, n0, n1, n2 = c[0], c[1], c[2], c[3], c[4], c[5]
        b0, b1, b2 = 0.0, 0.0, 0.0
        for r in range(m):
            a, x = rows.matrix[link, r], scan.weighed[r]
            b0 += x * (a[0] + a[4] * c2 - a[5] * c1)
            b1 += x * (a[1] + a[5] * c0 - a[3] * c2)
            b2 += x * (a[2] + a[3] * c1 - a[4] * c0)
        along = (force * force - across) * (b0 * n0 + b1 * n1 + b2 * n2)
        out[e, 0], out[e, 1], out[e, 2] = (
            across * b0 + along * n0,
            across * b1 + along * n1,
            across * b2 + along * n2,
        )
