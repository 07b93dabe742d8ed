"""The search where the measurement leaves the place open: explanations are gathered from all cells of the
surface that `contactsense.sift` leaves."""

import math

from contactsense.candidates import MOST, store, turn
from contactsense.cover import clearance, exposed
from contactsense.energy import lean_in
from contactsense.refine import CUT, refine
from contactsense.sift import sift
from contactsense.view import view
from robots.compiled import fused_kernel
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
    rows, best = sift(
        surfaces, places, parts, touchable, depth, motion, hypotheses, aimed, prior, cells, found
    )
    if best == -math.inf:
        return 0
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
    view(hypotheses.wrench[link], hypotheses.information[link], found.rotation[p], found.origin[p], w, L)
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
