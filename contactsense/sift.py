"""Which cells of the surface a measurement leaves: all places are weighed (see `contactsense.survey`), then
the parts of the best cells."""

import math

import numpy as np

from contactsense.aim import moment_variance
from contactsense.refine import CUT
from contactsense.survey import weigh
from contactsense.view import view
from robots.compiled import fused_kernel, inlined_fused_kernel

SPLIT = 3.0
"""Cells whose log evidence is worse than the best by less than this are looked at in parts, ..."""
FEW = 32
"""... unless there are more of them than this: an answer that is spread over so many does not depend on how
fine they are."""
STRONGEST = 3.0
"""How many standard deviations more than measured the force may be."""


@fused_kernel
def sift(  # type: ignore[no-untyped-def]
    surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, work, cells, found
):
    """Fill a row of `cells` for each cell, or part of one, that is not beyond hope.

    Args:
        surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, work, found: As in
            `contactsense.locate.locate`, the primitives placed already.
        cells: Filled: see `contactsense.cells.Cells`.

    Returns:
        How many rows, and the best log evidence, -infinity without any.
    """
    rows, least = _weigh_places(
        surfaces, places, touchable, depth, motion, hypotheses, aimed, prior, work, cells, found
    )
    best = _best_score(cells, rows)
    if best > -math.inf and _count_above(cells, rows, best - SPLIT) <= FEW:
        rows = _weigh_parts(surfaces, parts, depth, motion, hypotheses, prior, work, cells, rows, best, least)
        best = _best_score(cells, rows)
    return rows, best


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
    room = (math.sqrt(ff) + STRONGEST * math.sqrt(loose)) ** 2
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
