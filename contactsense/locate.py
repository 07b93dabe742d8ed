"""Where the arm is touched: every touchable primitive is tried, and link and place are decided together.

For each link's fused wrench, the search on a primitive starts where the wrench axis enters it and ends at the
most probable place. The places on all primitives of all links compete on one scale, the log evidence: fit of
the torques and of the base wrench, plausibility of force direction and torsion, and how sharply the place is
determined (theory, sections 3 to 5).
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.isolation import Hypotheses
from contactsense.refine import CUT, TAIL, Prior, Work, energy_at, lean_in, loosen, refine, view
from contactsense.seed import enter
from kinematics.model import Motion
from robots.compiled import fused_kernel
from robots.surface import Surfaces, project


class Candidates(NamedTuple):
    """Explanations of one measurement. Row p belongs to primitive p; `order` lists the rows that count. Base
    axes."""

    order: np.ndarray
    """Rows by falling probability, shape (P,), int64."""
    score: np.ndarray
    """Log evidence, shape (P,)."""
    probability: np.ndarray
    """Probability of those that `order` lists, shape (P,)."""
    point: np.ndarray
    """Contact centroid [m], shape (P, 3)."""
    normal: np.ndarray
    """Outward unit normal, shape (P, 3)."""
    force: np.ndarray
    """Force on the robot [N], shape (P, 3)."""
    torsion: np.ndarray
    """Moment on the robot about the outward normal [Nm], shape (P,)."""
    covariance: np.ndarray
    """Covariance of `point` [m^2], shape (P, 3, 3)."""
    wrench: np.ndarray
    """Fused wrench of the link's hypothesis in each primitive's body frame, shape (P, 6) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (P, 6, 6)."""
    rotation: np.ndarray
    """Axes of every primitive's body frame in the base frame, shape (P, 3, 3)."""
    origin: np.ndarray
    """Origin of every primitive's body frame in the base frame [m], shape (P, 3)."""


def empty_candidates(primitives: int) -> Candidates:
    """Arrays for that many primitives."""
    return Candidates(
        order=np.zeros(primitives, dtype=np.int64),
        score=np.zeros(primitives),
        probability=np.zeros(primitives),
        point=np.zeros((primitives, 3)),
        normal=np.zeros((primitives, 3)),
        force=np.zeros((primitives, 3)),
        torsion=np.zeros(primitives),
        covariance=np.zeros((primitives, 3, 3)),
        wrench=np.zeros((primitives, 6)),
        information=np.zeros((primitives, 6, 6)),
        rotation=np.zeros((primitives, 3, 3)),
        origin=np.zeros((primitives, 3)),
    )


@fused_kernel
def locate(
    surfaces: Surfaces,
    touchable: np.ndarray,
    depth: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    aimed: bool,
    prior: Prior,
    work: Work,
    found: Candidates,
    link_probability: np.ndarray,
) -> int:
    """Find all places on all links that explain the measurement.

    Args:
        surfaces: Primitives in the frames of the bodies that carry them.
        touchable: 1 for links that can be touched, else 0, shape (links,), int64.
        depth: Number of joints between the base and each link, shape (links,), int64.
        motion: Poses, see `kinematics.core.place`.
        hypotheses: One fused wrench per link, see `contactsense.isolation.isolate`.
        aimed: Whether all six components of the wrench were measured, so that its axis tells where to look.
        prior: What is known of contacts beforehand.
        work: Scratch.
        found: Filled: the explanations, sorted by `order`.
        link_probability: Filled, shape (links,).

    Returns:
        Number of explanations; 0 where no link can explain the measurement by a push.
    """
    _place_primitives(surfaces, depth, motion, found)
    count = _aim_all(surfaces, touchable, hypotheses, aimed, prior, found, work)
    least = math.inf
    best = -math.inf
    for i in range(count):
        # Most promising first, so that the others can be given up early.
        for k in range(i + 1, count):
            if found.score[found.order[k]] < found.score[found.order[i]]:
                found.order[i], found.order[k] = found.order[k], found.order[i]
        p = found.order[i]
        link = surfaces.link[p]
        own = hypotheses.energy[link]
        if own > least + CUT:
            found.score[p] = -math.inf
            continue
        w, L = found.wrench[p], found.information[p]
        kind, size = surfaces.kind[p], surfaces.size[p]
        limit = least + CUT - own
        if aimed:
            c, n = found.point[p], found.normal[p]
            result = refine(kind, size, w, L, prior, limit, c[0], c[1], c[2], n[0], n[1], n[2], work)
        else:
            result = _from_sides(kind, size, surfaces.radius[p], w, L, prior, limit, work)
        found.score[p] = result[1] - own
        if result[1] > -math.inf:
            _store(found, p, result, work, prior.offset)
            least = min(least, own + result[0])
            best = max(best, found.score[p])
    _cover(surfaces, found, count, best, prior.offset)
    kept: int = _rank(surfaces, found, count, 2.0 * prior.offset, link_probability)
    return kept


@fused_kernel
def _place_primitives(surfaces, depth, motion, found):  # type: ignore[no-untyped-def]
    """Body frames of all primitives in the base frame."""
    for p in range(surfaces.kind.shape[0]):
        body = depth[surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        S, s = surfaces.rotation[p], surfaces.origin[p]
        for i in range(3):
            found.origin[p, i] = o[i] + R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]
            for k in range(3):
                found.rotation[p, i, k] = R[i, 0] * S[0, k] + R[i, 1] * S[1, k] + R[i, 2] * S[2, k]


@fused_kernel
def _aim_all(surfaces, touchable, hypotheses, aimed, prior, found, work):  # type: ignore[no-untyped-def]
    """First guess on every touchable primitive that is worth a search: listed in `order`, its energy as
    `score`.

    The guess, body frame, is where the wrench axis enters the primitive or comes nearest. A primitive is left
    out where bringing the axis to it costs more than the search would forgive.
    """
    ceiling = math.inf
    count = 0
    last, last_energy = -1, -math.inf
    for _ in range(touchable.shape[0]):
        # Links by rising energy: the first ones set a ceiling above which the last ones need no look.
        link, own = -1, math.inf
        for k in range(touchable.shape[0]):
            e = hypotheses.energy[k]
            later = e > last_energy or (e == last_energy and k > last)
            if touchable[k] and later and (link < 0 or e < own):
                link, own = k, e
        if link < 0 or own > ceiling + CUT:
            break
        last, last_energy = link, own
        w, P, L = hypotheses.wrench[link], hypotheses.covariance[link], hypotheses.information[link]
        fx, fy, fz = w[0], w[1], w[2]
        ff = fx * fx + fy * fy + fz * fz
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            if not aimed:
                view(w, L, found.rotation[p], found.origin[p], found.wrench[p], found.information[p], work)
                found.score[p] = own
                found.order[count] = p
                count += 1
                continue
            if ff <= 0.0:
                continue
            ox, oy, oz = found.origin[p, 0], found.origin[p, 1], found.origin[p, 2]
            mx, my, mz = w[3] - oy * fz + oz * fy, w[4] - oz * fx + ox * fz, w[5] - ox * fy + oy * fx
            ax, ay, az = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
            gap = math.sqrt(ax * ax + ay * ay + az * az) / ff - surfaces.radius[p]
            # Energy of bringing the axis nearer by one metre, about: the moment about o must change by |f|.
            per_gap = 0.5 * ff / (_moment_variance(P, ox, oy, oz) + prior.offset * prior.offset * ff)
            limit = ceiling + CUT - own
            if gap > 0.0 and per_gap * gap * gap > limit:
                continue
            v, B = found.wrench[p], found.information[p]
            view(w, L, found.rotation[p], found.origin[p], v, B, work)
            kind, size, radius = surfaces.kind[p], surfaces.size[p], surfaces.radius[p]
            gap, cx, cy, cz, nx, ny, nz = enter(kind, size, radius, v[0], v[1], v[2], v[3], v[4], v[5])
            if per_gap * gap * gap > limit:
                continue
            hx, hy, hz = lean_in(v[0], v[1], v[2], nx, ny, nz)
            loose = loosen(B, prior, nx, ny, nz, hx, hy, hz)
            energy = own + energy_at(v, B, prior, loose, cx, cy, cz, nx, ny, nz, hx, hy, hz, 0.0)
            ceiling = min(ceiling, energy)
            found.point[p, 0], found.point[p, 1], found.point[p, 2] = cx, cy, cz
            found.normal[p, 0], found.normal[p, 1], found.normal[p, 2] = nx, ny, nz
            found.score[p] = energy
            found.order[count] = p
            count += 1
    return count


@fused_kernel
def _moment_variance(P, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Trace of the covariance of the moment about a point, P being that of the wrench about the
    origin."""
    cross = oz * (P[0, 4] - P[1, 3]) + oy * (P[2, 3] - P[0, 5]) + ox * (P[1, 5] - P[2, 4])
    oo = ox * ox + oy * oy + oz * oz
    oPo = (
        ox * (P[0, 0] * ox + 2.0 * P[0, 1] * oy + 2.0 * P[0, 2] * oz)
        + oy * (P[1, 1] * oy + 2.0 * P[1, 2] * oz)
        + oz * oz * P[2, 2]
    )
    trace = P[3, 3] + P[4, 4] + P[5, 5] - 2.0 * cross + oo * (P[0, 0] + P[1, 1] + P[2, 2]) - oPo
    return max(trace, 0.0)


@fused_kernel
def _from_sides(kind, size, radius, w, L, prior, limit, work):  # type: ignore[no-untyped-def]
    """Best of several searches, one from each side of a body: for a wrench too little known to aim with."""
    best = (math.inf, -math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for side in range(7):
        if side < 6:
            reach = 2.0 * radius if side < 3 else -2.0 * radius
            axis = side % 3
            x = reach if axis == 0 else 0.0
            y = reach if axis == 1 else 0.0
            z = reach if axis == 2 else 0.0
            _, cx, cy, cz, nx, ny, nz = project(kind, size, x, y, z)
        elif best[1] > -math.inf:
            # Once more from the best, so that the scratch holds its frame.
            cx, cy, cz, nx, ny, nz = best[2], best[3], best[4], best[5], best[6], best[7]
        else:
            break
        result = refine(kind, size, w, L, prior, limit, cx, cy, cz, nx, ny, nz, work)
        if result[1] > best[1] or side == 6:
            best = result
    return best


@fused_kernel
def _turn(R, x, y, z, out):  # type: ignore[no-untyped-def]
    """out = R (x, y, z)."""
    for i in range(3):
        out[i] = R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@fused_kernel
def _store(found, p, result, work, offset):  # type: ignore[no-untyped-def]
    """Keep one result of `refine` in base axes."""
    _, _, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, v11, v12, v22 = result
    R, o, T = found.rotation[p], found.origin[p], work.frame
    _turn(R, cx, cy, cz, found.point[p])
    _turn(R, nx, ny, nz, found.normal[p])
    _turn(R, fx, fy, fz, found.force[p])
    found.torsion[p] = xi
    t1, t2 = work.gradient[:3], work.gradient[3:]
    _turn(R, T[0, 1], T[1, 1], T[2, 1], t1)
    _turn(R, T[0, 2], T[1, 2], T[2, 2], t2)
    n = found.normal[p]
    for i in range(3):
        found.point[p, i] += o[i]
        for k in range(3):
            found.covariance[p, i, k] = (
                t1[i] * (v11 * t1[k] + v12 * t2[k])
                + t2[i] * (v12 * t1[k] + v22 * t2[k])
                + n[i] * n[k] * offset * offset
            )


@fused_kernel
def _cover(surfaces, found, count, best, spread):  # type: ignore[no-untyped-def]
    """Lower the score of places that lie inside another primitive of their link or of a neighbour.

    A place inside is no place of the surface. It still counts as one by as much as the surface may be off.
    What stands on the mounting plane, z = 0 of the base frame, cannot be touched from below.
    """
    for i in range(count):
        own = found.order[i]
        if found.score[own] < best - CUT:
            continue
        link = surfaces.link[own]
        first = surfaces.start[max(link - 1, 0)]
        last = surfaces.start[min(link + 2, surfaces.start.shape[0] - 1)]
        deepest = 0.0
        x, y, z = found.point[own, 0], found.point[own, 1], found.point[own, 2]
        if link == 0 and z < spread and found.normal[own, 2] < -0.5:
            # The face on which the base stands.
            found.score[own] = -math.inf
            continue
        for p in range(first, last):
            o = found.origin[p]
            dx, dy, dz = x - o[0], y - o[1], z - o[2]
            if p == own or dx * dx + dy * dy + dz * dz > surfaces.radius[p] ** 2:
                continue
            R = found.rotation[p]
            d = project(
                surfaces.kind[p],
                surfaces.size[p],
                R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
                R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
                R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
            )[0]
            deepest = min(deepest, d)
        found.score[own] -= 0.5 * (TAIL + 1.0) * math.log(1.0 + (deepest / spread) ** 2 / TAIL)


@fused_kernel
def _rank(surfaces, found, count, apart, link_probability):  # type: ignore[no-untyped-def]
    """Sort the explanations, drop doubles and the hopeless, turn scores into probabilities; how many are
    left."""
    kept = 0
    best = 0.0
    total = 0.0
    for i in range(count):
        for k in range(i + 1, count):
            if found.score[found.order[k]] > found.score[found.order[i]]:
                found.order[i], found.order[k] = found.order[k], found.order[i]
        p = found.order[i]
        if i == 0:
            best = found.score[p]
        if not found.score[p] >= best - CUT or best == -math.inf:
            break
        if not _is_double(surfaces, found, p, kept, apart):
            found.order[kept] = p
            found.probability[p] = math.exp(found.score[p] - best)
            total += found.probability[p]
            kept += 1
    link_probability[:] = 0.0
    for i in range(kept):
        p = found.order[i]
        found.probability[p] /= total
        link_probability[surfaces.link[p]] += found.probability[p]
    return kept


@fused_kernel
def _is_double(surfaces, found, p, kept, apart):  # type: ignore[no-untyped-def]
    """Whether a better explanation on the same link, among the first `kept`, lies closer than `apart`."""
    for i in range(kept):
        q = found.order[i]
        if surfaces.link[q] == surfaces.link[p]:
            dx = found.point[q, 0] - found.point[p, 0]
            dy = found.point[q, 1] - found.point[p, 1]
            dz = found.point[q, 2] - found.point[p, 2]
            if dx * dx + dy * dy + dz * dz < apart * apart:
                return True
    return False
