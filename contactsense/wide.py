"""The search where the measurement leaves the place open: all places are weighed, then the parts of the best
cells, and explanations are gathered from them (see `contactsense.survey`)."""

import math

import numpy as np

from contactsense.aim import moment_variance
from contactsense.candidates import MOST, store, turn
from contactsense.cover import clearance, exposed
from contactsense.energy import lean_in
from contactsense.refine import CUT, refine
from contactsense.survey import weigh
from contactsense.view import view
from robots.compiled import fused_kernel, inlined_fused_kernel
from robots.surface import project
from robots.union import nearest

REACH = 0.04
"""Cells nearer than this to an explanation's place are part of it, however sharp it is [m]."""
SIGMAS = 3.0
"""So are cells within this many standard deviations."""
CREASE = 8
"""Most projections onto a link's surface until a place is on it."""
BURIED = 1e-7
"""Places inside the surface by less than this are on it [m]."""
SPLIT = 3.0
"""Cells whose log evidence is worse than the best by less than this are looked at in parts, ..."""
FEW = 32
"""... unless there are more of them than this: an answer that is spread over so many does not depend on how
fine they are."""
NARROW = 2.0
"""Answers narrower than this many cells, standard deviations, are told by the search alone: the mean over so
few cells depends on where they happen to lie."""
LEAST = 1e-3
"""Cells that hold less than this part of the best explanation's weight get no explanation of their own."""


@fused_kernel
def search_over(  # type: ignore[no-untyped-def]
    surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, work, cells, found, rest
):
    """Fill rows of `found` with explanations; `order` lists them.

    Args:
        surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, work, found: As in
            `contactsense.locate.locate`, the primitives placed already.
        cells: Scratch, filled: see `contactsense.cells.Cells`.
        rest: Filled: log evidence on each link that no explanation stands for, shape (links,).

    Returns:
        How many explanations.
    """
    rest[:] = -math.inf
    rows, least = _weigh_places(
        surfaces, places, touchable, depth, motion, hypotheses, aimed, prior, work, cells, found
    )
    best = _best_score(cells, rows)
    if best == -math.inf:
        return 0
    if _count_above(cells, rows, best - SPLIT) <= FEW:
        rows = _weigh_parts(surfaces, parts, depth, motion, hypotheses, prior, work, cells, rows, best, least)
        best = _best_score(cells, rows)
    _cover_cells(surfaces, depth, motion, prior, cells, found, rows, best)
    count = 0
    top = -math.inf
    for _ in range(MOST):
        s = _best_cell(cells, rows)
        if s < 0 or cells.score[s] < max(best - CUT, top + math.log(LEAST)):
            break
        _explain(surfaces, depth, motion, hypotheses, prior, work, cells, rows, found, s, count)
        found.order[count] = count
        top = max(top, found.score[count])
        count += 1
    for s in range(rows):
        if cells.score[s] > best - CUT:
            link = surfaces.link[cells.primitive[s]]
            rest[link] = _log_add(rest[link], cells.score[s])
    return count


@fused_kernel
def _log_add(a, b):  # type: ignore[no-untyped-def]
    high, low = max(a, b), min(a, b)
    return high if low == -math.inf else high + math.log1p(math.exp(low - high))


@fused_kernel
def _weigh_places(  # type: ignore[no-untyped-def]
    surfaces, places, touchable, depth, motion, hypotheses, aimed, prior, work, cells, found
):
    """A row of `cells` for each place that is not beyond hope; how many, and the least energy."""
    rows = 0
    least = math.inf
    links = touchable.shape[0]
    first = np.argmin(hypotheses.energy)
    for k in range(links):
        # The best link first, so that places on the others can be given up early.
        link = (first + k) % links
        if not touchable[link] or hypotheses.energy[link] > least + CUT:
            continue
        ff, loose = _look_at(link, depth, motion, hypotheses, cells, work)
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            if aimed and _far(surfaces, hypotheses, prior, found, link, p, ff):
                continue
            for s in range(places.start[p], places.start[p + 1]):
                energy = _weigh_one(
                    places, s, p, link, depth, motion, hypotheses, prior, ff, loose, least, cells, rows, work
                )
                if energy < math.inf:
                    cells.place[rows] = s
                    least = min(least, energy)
                    rows += 1
    return rows, least


@fused_kernel
def _weigh_parts(  # type: ignore[no-untyped-def]
    surfaces, parts, depth, motion, hypotheses, prior, work, cells, rows, best, least
):
    """Put parts in the place of the best cells; how many rows there are then."""
    last = -1
    ff, loose = 0.0, 0.0
    cell_rows = rows
    for row in range(cell_rows):
        if cells.score[row] < best - SPLIT:
            continue
        link = surfaces.link[cells.primitive[row]]
        if link != last:
            last = link
            ff, loose = _look_at(link, depth, motion, hypotheses, cells, work)
        cells.score[row] = -math.inf
        for s in range(parts.start[cells.place[row]], parts.start[cells.place[row] + 1]):
            p = parts.primitive[s]
            energy = _weigh_one(
                parts, s, p, link, depth, motion, hypotheses, prior, ff, loose, least, cells, rows, work
            )
            if energy < math.inf:
                least = min(least, energy)
                rows += 1
    return rows


@fused_kernel
def _look_at(link, depth, motion, hypotheses, cells, work):  # type: ignore[no-untyped-def]
    """Put the wrench of a link's hypothesis into the link's frame; its squared force and the variance of
    that."""
    R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
    w, P = cells.wrench, hypotheses.covariance[link]
    view(hypotheses.wrench[link], hypotheses.information[link], R, o, w, cells.information, work)
    return w[0] * w[0] + w[1] * w[1] + w[2] * w[2], P[0, 0] + P[1, 1] + P[2, 2]


@inlined_fused_kernel
def _weigh_one(  # type: ignore[no-untyped-def]
    pieces, s, p, link, depth, motion, hypotheses, prior, ff, loose, least, cells, row, work
):
    """Weigh piece s of the surface, on primitive p, and keep it in a row; its energy, infinite where it is
    beyond hope."""
    R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
    c, n, w = pieces.point[s], pieces.normal[s], cells.wrench
    limit = least + CUT - hypotheses.energy[link]
    known = loose < ff
    # Variance of the moment per squared lever, for as great a force as may be.
    room = (math.sqrt(ff) + SIGMAS * math.sqrt(loose)) ** 2
    if known and misses(
        hypotheses.wrench[link],
        hypotheses.covariance[link],
        o[0] + R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2],
        o[1] + R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2],
        o[2] + R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2],
        room * (pieces.spread[s] ** 2 + prior.lever**2),
        limit,
    ):
        return math.inf
    if known and n[0] * w[0] + n[1] * w[1] + n[2] * w[2] > 0.5 * math.sqrt(ff):
        # A pull, as far as the force is known.
        return math.inf
    energy, log_z, px, py, pz, variance, fx, fy, fz = weigh(
        w,
        cells.information,
        prior,
        c[0],
        c[1],
        c[2],
        n[0],
        n[1],
        n[2],
        pieces.spread[s],
        known,
        limit,
        work,
    )
    if log_z == -math.inf:
        return math.inf
    cells.primitive[row] = p
    cells.score[row] = log_z - hypotheses.energy[link] + pieces.log_share[s]
    cells.point[row, 0], cells.point[row, 1], cells.point[row, 2] = px, py, pz
    cells.normal[row, 0], cells.normal[row, 1], cells.normal[row, 2] = n[0], n[1], n[2]
    cells.force[row, 0], cells.force[row, 1], cells.force[row, 2] = fx, fy, fz
    cells.variance[row] = variance
    cells.spread[row] = pieces.spread[s]
    return hypotheses.energy[link] + energy


@fused_kernel
def _count_above(cells, rows, least):  # type: ignore[no-untyped-def]
    """How many rows have a greater score."""
    count = 0
    for s in range(rows):
        if cells.score[s] > least:
            count += 1
    return count


@fused_kernel
def _best_score(cells, rows):  # type: ignore[no-untyped-def]
    """Greatest score of all rows, -infinity without any."""
    best = -math.inf
    for s in range(rows):
        best = max(best, cells.score[s])
    return best


@fused_kernel
def misses(w, P, x, y, z, spread, limit):  # type: ignore[no-untyped-def]
    """Whether the moment about a place is more than noise (P), torsion and the cell's width (`spread`, their
    variance) make of it: an energy above the limit, whatever the force is."""
    a, b, c = w[3] - y * w[2] + z * w[1], w[4] - z * w[0] + x * w[2], w[5] - x * w[1] + y * w[0]
    # Covariance of that moment, P_mm - X G^T - G X^T with G = P_mf - 1/2 X P_ff, X = [c]x.
    hx, hy, hz = 0.5 * x, 0.5 * y, 0.5 * z
    g00 = P[3, 0] - hy * P[2, 0] + hz * P[1, 0]
    g01 = P[3, 1] - hy * P[2, 1] + hz * P[1, 1]
    g02 = P[3, 2] - hy * P[2, 2] + hz * P[1, 2]
    g10 = P[4, 0] - hz * P[0, 0] + hx * P[2, 0]
    g11 = P[4, 1] - hz * P[0, 1] + hx * P[2, 1]
    g12 = P[4, 2] - hz * P[0, 2] + hx * P[2, 2]
    g20 = P[5, 0] - hx * P[1, 0] + hy * P[0, 0]
    g21 = P[5, 1] - hx * P[1, 1] + hy * P[0, 1]
    g22 = P[5, 2] - hx * P[1, 2] + hy * P[0, 2]
    s00 = P[3, 3] + spread - 2.0 * (y * g02 - z * g01)
    s11 = P[4, 4] + spread - 2.0 * (z * g10 - x * g12)
    s22 = P[5, 5] + spread - 2.0 * (x * g21 - y * g20)
    s01 = P[3, 4] - (y * g12 - z * g11) - (z * g00 - x * g02)
    s02 = P[3, 5] - (y * g22 - z * g21) - (x * g01 - y * g00)
    s12 = P[4, 5] - (z * g20 - x * g22) - (x * g11 - y * g10)
    c00, c01, c02 = s11 * s22 - s12 * s12, s02 * s12 - s01 * s22, s01 * s12 - s02 * s11
    c11, c12, c22 = s00 * s22 - s02 * s02, s01 * s02 - s00 * s12, s00 * s11 - s01 * s01
    det = s00 * c00 + s01 * c01 + s02 * c02
    square = a * a * c00 + b * b * c11 + c * c * c22 + 2.0 * (a * b * c01 + a * c * c02 + b * c * c12)
    return 0.5 * square > limit * det


@fused_kernel
def _far(surfaces, hypotheses, prior, found, link, p, ff):  # type: ignore[no-untyped-def]
    """Whether the wrench axis passes too far from a primitive."""
    w = hypotheses.wrench[link]
    ox, oy, oz = found.origin[p, 0], found.origin[p, 1], found.origin[p, 2]
    mx, my, mz = w[3] - oy * w[2] + oz * w[1], w[4] - oz * w[0] + ox * w[2], w[5] - ox * w[1] + oy * w[0]
    ax, ay, az = w[1] * mz - w[2] * my, w[2] * mx - w[0] * mz, w[0] * my - w[1] * mx
    if ff == 0.0:
        return False
    gap = math.sqrt(ax * ax + ay * ay + az * az) / ff - surfaces.radius[p]
    variance = moment_variance(hypotheses.covariance[link], ox, oy, oz) + prior.offset * prior.offset * ff
    return gap > 0.0 and 0.5 * ff * gap * gap > 2.0 * CUT * variance


@fused_kernel
def _cover_cells(surfaces, depth, motion, prior, cells, found, rows, best):  # type: ignore[no-untyped-def]
    """Lower the score of cells that neighbours cover."""
    for s in range(rows):
        if cells.score[s] < best - CUT:
            continue
        p = cells.primitive[s]
        body = depth[surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        n, room = cells.normal[s], prior.room
        x = cells.point[s, 0] + room * n[0]
        y = cells.point[s, 1] + room * n[1]
        z = cells.point[s, 2] + room * n[2]
        free = clearance(
            surfaces,
            found,
            p,
            o[0] + R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
            o[1] + R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
            o[2] + R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
            0.0,
        )
        cells.score[s] += math.log(exposed(free, prior))


@fused_kernel
def _best_cell(cells, rows):  # type: ignore[no-untyped-def]
    """Row of the best cell that is left; -1 if none is."""
    best, which = -math.inf, -1
    for s in range(rows):
        if cells.score[s] > best:
            best, which = cells.score[s], s
    return which


@fused_kernel
def _explain(  # type: ignore[no-untyped-def]
    surfaces, depth, motion, hypotheses, prior, work, cells, rows, found, s, row
):
    """One explanation, found from cell s, with the cells that belong to it, which are used up."""
    p = cells.primitive[s]
    link = surfaces.link[p]
    w, L = found.wrench[p], found.information[p]
    view(
        hypotheses.wrench[link], hypotheses.information[link], found.rotation[p], found.origin[p], w, L, work
    )
    S, t = surfaces.rotation[p], surfaces.origin[p]
    dx, dy, dz = cells.point[s, 0] - t[0], cells.point[s, 1] - t[1], cells.point[s, 2] - t[2]
    _, cx, cy, cz, nx, ny, nz = project(
        surfaces.kind[p],
        surfaces.size[p],
        S[0, 0] * dx + S[1, 0] * dy + S[2, 0] * dz,
        S[0, 1] * dx + S[1, 1] * dy + S[2, 1] * dz,
        S[0, 2] * dx + S[1, 2] * dy + S[2, 2] * dz,
    )
    f = cells.force[s]
    fx = S[0, 0] * f[0] + S[1, 0] * f[1] + S[2, 0] * f[2]
    fy = S[0, 1] * f[0] + S[1, 1] * f[1] + S[2, 1] * f[2]
    fz = S[0, 2] * f[0] + S[1, 2] * f[1] + S[2, 2] * f[2]
    fx, fy, fz = lean_in(fx, fy, fz, nx, ny, nz)
    result = refine(
        surfaces.kind[p],
        surfaces.size[p],
        w,
        L,
        prior,
        math.inf,
        cx,
        cy,
        cz,
        nx,
        ny,
        nz,
        fx,
        fy,
        fz,
        0.0,
        work,
    )
    store(found, row, p, result, work, prior.offset)
    sharp = max(result[12], result[14])
    R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
    x, y, z = found.point[row, 0] - o[0], found.point[row, 1] - o[1], found.point[row, 2] - o[2]
    kx = R[0, 0] * x + R[1, 0] * y + R[2, 0] * z
    ky = R[0, 1] * x + R[1, 1] * y + R[2, 1] * z
    kz = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
    exact = result[1] > -math.inf
    reach = max(REACH, SIGMAS * math.sqrt(sharp)) if exact else REACH
    total, mean, C = _gather(surfaces, cells, rows, s, kx, ky, kz, reach)
    found.score[row] = total
    # Not much wider than a cell, the search's place is better than the mean over the cells' tangent planes.
    part = 0.0 if exact and C[0] + C[3] + C[5] < 2.0 * (NARROW * cells.spread[s]) ** 2 else 1.0
    told = _tell(
        surfaces, found, row, link, R, o, kx + part * mean[0], ky + part * mean[1], kz + part * mean[2]
    )
    dx, dy, dz = told[0] - kx, told[1] - ky, told[2] - kz
    # Second moments about the new place.
    C = (
        C[0] - 2.0 * mean[0] * dx + dx * dx,
        C[1] - mean[0] * dy - mean[1] * dx + dx * dy,
        C[2] - mean[0] * dz - mean[2] * dx + dx * dz,
        C[3] - 2.0 * mean[1] * dy + dy * dy,
        C[4] - mean[1] * dz - mean[2] * dy + dy * dz,
        C[5] - 2.0 * mean[2] * dz + dz * dz,
    )
    _spread_over(found, row, R, C, prior.offset)


@fused_kernel
def _tell(surfaces, found, row, link, R, o, x, y, z):  # type: ignore[no-untyped-def]
    """Move an explanation to the place of the link's surface that is nearest to (x, y, z); where that is,
    link frame."""
    p, nx, ny, nz = -1, 0.0, 0.0, 0.0
    for _ in range(CREASE):
        # In a crease, the surface of one primitive may lie inside another.
        depth, p, x, y, z, nx, ny, nz = nearest(
            surfaces.kind,
            surfaces.rotation,
            surfaces.origin,
            surfaces.size,
            surfaces.radius,
            surfaces.start[link],
            surfaces.start[link + 1],
            x,
            y,
            z,
        )
        if depth > -BURIED:
            break
    found.primitive[row] = p
    turn(R, x, y, z, found.point[row])
    turn(R, nx, ny, nz, found.normal[row])
    for i in range(3):
        found.point[row, i] += o[i]
    return x, y, z


@fused_kernel
def _gather(surfaces, cells, rows, s, x, y, z, reach):  # type: ignore[no-untyped-def]
    """Use up cell s and those of its link that lie within `reach` of a place; their total score, their mean
    place from it (x, y, z) [m], and second moments about it (xx, xy, xz, yy, yz, zz) [m^2], link frame."""
    link = surfaces.link[cells.primitive[s]]
    top = cells.score[s]
    mx, my, mz = 0.0, 0.0, 0.0
    total, xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(rows):
        if cells.score[i] == -math.inf or surfaces.link[cells.primitive[i]] != link:
            continue
        dx, dy, dz = cells.point[i, 0] - x, cells.point[i, 1] - y, cells.point[i, 2] - z
        if i != s and dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        weight = math.exp(cells.score[i] - top)
        cells.score[i] = -math.inf
        n, v = cells.normal[i], cells.variance[i]
        total += weight
        mx += weight * dx
        my += weight * dy
        mz += weight * dz
        xx += weight * (dx * dx + v * (1.0 - n[0] * n[0]))
        xy += weight * (dx * dy - v * n[0] * n[1])
        xz += weight * (dx * dz - v * n[0] * n[2])
        yy += weight * (dy * dy + v * (1.0 - n[1] * n[1]))
        yz += weight * (dy * dz - v * n[1] * n[2])
        zz += weight * (dz * dz + v * (1.0 - n[2] * n[2]))
    moments = (xx / total, xy / total, xz / total, yy / total, yz / total, zz / total)
    return top + math.log(total), (mx / total, my / total, mz / total), moments


@fused_kernel
def _spread_over(found, row, R, C, offset):  # type: ignore[no-untyped-def]
    """Covariance of a place from second moments C in the link frame, and the surface's offset."""
    n = found.normal[row]
    for i in range(3):
        a = R[i, 0] * C[0] + R[i, 1] * C[1] + R[i, 2] * C[2]
        b = R[i, 0] * C[1] + R[i, 1] * C[3] + R[i, 2] * C[4]
        c = R[i, 0] * C[2] + R[i, 1] * C[4] + R[i, 2] * C[5]
        for k in range(3):
            found.covariance[row, i, k] = (
                a * R[k, 0] + b * R[k, 1] + c * R[k, 2] + offset * offset * n[i] * n[k]
            )
