"""Which cells of the surface a measurement leaves: all places are weighed (see `contactsense.survey`), then
the parts of the best cells.

Cells go through in blocks, all of a block on one link (see `contactsense.lanes`): a first look at `LANES` of
them leaves some, and as soon as that many are left they are weighed.
"""

import math

import numpy as np

from contactsense.aim import moment_variance
from contactsense.glance import glance
from contactsense.lanes import LANES, NX, NY, NZ, OUT, SPREAD, VARIANCE, X, Y, Z
from contactsense.refine import CUT
from contactsense.survey import evidence, weigh
from contactsense.view import view
from robots.compiled import fused_kernel

SPLIT = 3.0
"""Cells whose log evidence is worse than the best by less than this are looked at in parts, ..."""
FEW = 32
"""... unless there are more of them than this: an answer that is spread over so many does not depend on how
fine they are."""


@fused_kernel
def sift(  # type: ignore[no-untyped-def]
    surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, cells, found
):
    """Fill a row of `cells` for each cell, or part of one, that is not beyond hope.

    Args:
        surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, found: As in
            `contactsense.locate.locate`, the primitives placed already.
        cells: Filled: see `contactsense.cells.Cells`.

    Returns:
        How many rows, and the best log evidence, -infinity without any.
    """
    rows, least = _weigh_places(
        surfaces, places, touchable, depth, motion, hypotheses, aimed, prior, cells, found
    )
    best = _best_score(cells, rows)
    if best > -math.inf and _count_above(cells, rows, best - SPLIT) <= FEW:
        rows = _weigh_parts(surfaces, parts, depth, motion, hypotheses, prior, cells, rows, best, least)
        best = _best_score(cells, rows)
    return rows, best


@fused_kernel
def _weigh_places(  # type: ignore[no-untyped-def]
    surfaces, places, touchable, depth, motion, hypotheses, aimed, prior, cells, found
):
    """A row of `cells` for each place that is not beyond hope; how many, and the least energy."""
    rows = 0
    least = math.inf
    links = touchable.shape[0]
    first = np.argmin(hypotheses.energy)
    for k in range(links):
        # The best link first, so that places on the others can be given up early.
        link = (first + k) % links
        own = hypotheses.energy[link]
        if not touchable[link] or own > least + CUT:
            continue
        R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
        w, P = hypotheses.wrench[link], hypotheses.covariance[link]
        ff, loose = _look_at(w, P, hypotheses.information[link], R, o, cells)
        known = loose < ff
        looked, left = 0, 0
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            if aimed and _far(w, P, found.origin, surfaces.radius, p, prior, ff):
                continue
            for s in range(places.start[p], places.start[p + 1]):
                _put(places, s, cells.looked, cells.looked_number, looked)
                looked += 1
                if looked == LANES:
                    if known:
                        glance(w, P, R, o, ff, loose, prior.lever, least + CUT - own, cells.looked)
                    rows, left, least = _pass_on(places, looked, left, known, prior, own, rows, least, cells)
                    looked = 0
        if known:
            glance(w, P, R, o, ff, loose, prior.lever, least + CUT - own, cells.looked)
        rows, left, least = _pass_on(places, looked, left, known, prior, own, rows, least, cells)
        if left > 0:
            rows, least = _weigh_block(places, left, known, prior, own, rows, least, cells)
    return rows, least


@fused_kernel
def _pass_on(places, looked, left, known, prior, own, rows, least, cells):  # type: ignore[no-untyped-def]
    """Pass the cells that a first look leaves to the other block, and weigh that when it is full. Number of
    rows, cells in that block, and the least energy."""
    for j in range(looked):
        # Where the force is not known, nothing can be said at first sight.
        if known and cells.looked[OUT + j] > 0.0:
            continue
        _put(places, cells.looked_number[j], cells.weighed, cells.weighed_number, left)
        left += 1
        if left == LANES:
            rows, least = _weigh_block(places, left, known, prior, own, rows, least, cells)
            left = 0
    return rows, left, least


@fused_kernel
def _weigh_parts(  # type: ignore[no-untyped-def]
    surfaces, parts, depth, motion, hypotheses, prior, cells, rows, best, least
):
    """Put parts in the place of the best cells; how many rows there are then."""
    last, left = -1, 0
    own, known = 0.0, False
    for row in range(rows):
        if cells.score[row] < best - SPLIT:
            continue
        link = surfaces.link[cells.primitive[row]]
        if link != last:
            if left > 0:
                rows, least = _weigh_block(parts, left, known, prior, own, rows, least, cells)
                left = 0
            last, own = link, hypotheses.energy[link]
            R, o = motion.rotation[depth[link]], motion.origin[depth[link]]
            w, P = hypotheses.wrench[link], hypotheses.covariance[link]
            ff, loose = _look_at(w, P, hypotheses.information[link], R, o, cells)
            known = loose < ff
        cells.score[row] = -math.inf
        for s in range(parts.start[cells.place[row]], parts.start[cells.place[row] + 1]):
            _put(parts, s, cells.weighed, cells.weighed_number, left)
            left += 1
            if left == LANES:
                rows, least = _weigh_block(parts, left, known, prior, own, rows, least, cells)
                left = 0
    if left > 0:
        rows, least = _weigh_block(parts, left, known, prior, own, rows, least, cells)
    return rows


@fused_kernel
def _look_at(w, P, L, R, o, cells):  # type: ignore[no-untyped-def]
    """Put the wrench of a link's hypothesis and its information into the link's frame; its squared force and
    the variance of that."""
    u = cells.wrench
    view(w, L, R, o, u, cells.information)
    return u[0] * u[0] + u[1] * u[1] + u[2] * u[2], P[0, 0] + P[1, 1] + P[2, 2]


@fused_kernel
def _put(pieces, s, lanes, number, j):  # type: ignore[no-untyped-def]
    """Put piece s of the surface into lane j of a block."""
    c, n = pieces.point, pieces.normal
    lanes[X + j], lanes[Y + j], lanes[Z + j] = c[s, 0], c[s, 1], c[s, 2]
    lanes[NX + j], lanes[NY + j], lanes[NZ + j] = n[s, 0], n[s, 1], n[s, 2]
    lanes[SPREAD + j] = pieces.spread[s]
    number[j] = s


@fused_kernel
def _weigh_block(pieces, count, known, prior, own, rows, least, cells):  # type: ignore[no-untyped-def]
    """Weigh a block of pieces of the surface, and keep those that are not beyond hope in rows; how many rows
    there are then, and the least energy."""
    lanes, limit = cells.weighed, least + CUT - own
    weigh(count, cells.wrench, cells.information, prior, known, limit, lanes)
    for j in range(count):
        energy, log_z, px, py, pz, fx, fy, fz = evidence(j, prior, limit, lanes)
        if log_z == -math.inf:
            continue
        s = cells.weighed_number[j]
        cells.place[rows], cells.primitive[rows] = s, pieces.primitive[s]
        cells.score[rows] = log_z - own + pieces.log_share[s]
        cells.point[rows, 0], cells.point[rows, 1], cells.point[rows, 2] = px, py, pz
        for i in range(3):
            cells.normal[rows, i] = pieces.normal[s, i]
        cells.force[rows, 0], cells.force[rows, 1], cells.force[rows, 2] = fx, fy, fz
        cells.variance[rows] = lanes[VARIANCE + j]
        cells.spread[rows] = pieces.spread[s]
        least = min(least, own + energy)
        rows += 1
    return rows, least


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
def _far(w, P, origin, radius, p, prior, ff):  # type: ignore[no-untyped-def]
    """Whether the wrench axis passes too far from primitive p."""
    ox, oy, oz = origin[p, 0], origin[p, 1], origin[p, 2]
    mx, my, mz = w[3] - oy * w[2] + oz * w[1], w[4] - oz * w[0] + ox * w[2], w[5] - ox * w[1] + oy * w[0]
    ax, ay, az = w[1] * mz - w[2] * my, w[2] * mx - w[0] * mz, w[0] * my - w[1] * mx
    if ff == 0.0:
        return False
    gap = math.sqrt(ax * ax + ay * ay + az * az) / ff - radius[p]
    if gap <= 0.0:
        return False
    variance = moment_variance(P, ox, oy, oz) + prior.offset * prior.offset * ff
    return 0.5 * ff * gap * gap > 2.0 * CUT * variance
