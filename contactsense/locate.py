"""Where the arm is touched: every touchable primitive is tried, and link and place are decided together.

For each link's fused wrench, a candidate starts where the wrench axis enters the primitive and is refined to its most
probable place. All candidates of all links compete on one scale, the log evidence: fit of the torques and of the
base wrench, plausibility of force direction and torsion, and how sharply the place is determined (theory, sections 3-5).
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.isolation import Hypotheses
from contactsense.refine import Prior, Work, nearest, refine, turn
from contactsense.seed import enter
from kinematics.model import Motion
from robots.compiled import kernel
from robots.surface import Surfaces

CUT = 16.0
"""Explanations whose log evidence is worse than the best by this much are dropped (probability 1e-7)."""


class Candidates(NamedTuple):
    """Explanations of one measurement, one row per primitive that was tried; `order` sorts them. Base axes."""

    order: np.ndarray
    """Rows by falling probability, shape (P,), int64."""
    primitive: np.ndarray
    """Number of the primitive in `Surfaces`, shape (P,), int64."""
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
    rotation: np.ndarray
    """Scratch: axes of every primitive's body frame in the base frame, shape (P, 3, 3)."""
    origin: np.ndarray
    """Scratch: origin of every primitive's body frame in the base frame [m], shape (P, 3)."""


def empty_candidates(primitives: int) -> Candidates:
    """Arrays for that many primitives."""
    return Candidates(
        order=np.zeros(primitives, dtype=np.int64),
        primitive=np.zeros(primitives, dtype=np.int64),
        score=np.zeros(primitives),
        probability=np.zeros(primitives),
        point=np.zeros((primitives, 3)),
        normal=np.zeros((primitives, 3)),
        force=np.zeros((primitives, 3)),
        torsion=np.zeros(primitives),
        covariance=np.zeros((primitives, 3, 3)),
        rotation=np.zeros((primitives, 3, 3)),
        origin=np.zeros((primitives, 3)),
    )


@kernel
def place_primitives(surfaces: Surfaces, depth: np.ndarray, motion: Motion, out: Candidates) -> None:
    """Body frames of all primitives in the base frame, for the links' poses in `motion`."""
    for p in range(surfaces.kind.shape[0]):
        body = depth[surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        S, s = surfaces.rotation[p], surfaces.origin[p]
        for i in range(3):
            out.origin[p, i] = o[i] + R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]
            for k in range(3):
                out.rotation[p, i, k] = R[i, 0] * S[0, k] + R[i, 1] * S[1, k] + R[i, 2] * S[2, k]


@kernel
def _least_energy(w, P, o, radius, offset):  # type: ignore[no-untyped-def]
    """About the least energy that moves the wrench axis into the ball of that radius about o."""
    fx, fy, fz = w[0], w[1], w[2]
    ff = fx * fx + fy * fy + fz * fz
    if ff <= 0.0:
        return 0.0
    ox, oy, oz = o[0], o[1], o[2]
    mx, my, mz = w[3] - oy * fz + oz * fy, w[4] - oz * fx + ox * fz, w[5] - ox * fy + oy * fx
    ax, ay, az = fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx
    gap = math.sqrt(ax * ax + ay * ay + az * az) / ff - radius
    if gap <= 0.0:
        return 0.0
    # Trace of the covariance of the moment about o.
    cross = oz * (P[0, 4] - P[1, 3]) + oy * (P[2, 3] - P[0, 5]) + ox * (P[1, 5] - P[2, 4])
    oo = ox * ox + oy * oy + oz * oz
    oPo = (
        ox * (P[0, 0] * ox + 2.0 * P[0, 1] * oy + 2.0 * P[0, 2] * oz)
        + oy * (P[1, 1] * oy + 2.0 * P[1, 2] * oz)
        + oz * oz * P[2, 2]
    )
    trace = P[3, 3] + P[4, 4] + P[5, 5] - 2.0 * cross + oo * (P[0, 0] + P[1, 1] + P[2, 2]) - oPo
    return 0.5 * gap * gap * ff / (max(trace, 0.0) + offset * offset * ff)


@kernel
def _cover(surfaces, found, count, best, spread):  # type: ignore[no-untyped-def]
    """Lower the score of candidates that lie inside another primitive of their link or of its neighbours.

    A place inside is no place of the surface. It counts as one by as much as the surface may be off.
    """
    for i in range(count):
        if found.score[i] < best - CUT:
            continue
        own = found.primitive[i]
        link = surfaces.link[own]
        first = surfaces.start[max(link - 1, 0)]
        last = surfaces.start[min(link + 2, surfaces.start.shape[0] - 1)]
        deepest = 0.0
        x, y, z = found.point[i, 0], found.point[i, 1], found.point[i, 2]
        for p in range(first, last):
            o = found.origin[p]
            dx, dy, dz = x - o[0], y - o[1], z - o[2]
            if p == own or dx * dx + dy * dy + dz * dz > surfaces.radius[p] ** 2:
                continue
            d = nearest(surfaces.kind[p], surfaces.size[p], found.rotation[p], o, x, y, z)[0]
            deepest = min(deepest, d)
        found.score[i] -= 0.5 * (deepest / spread) ** 2


@kernel
def _rank(surfaces, found, count, apart, link_probability):  # type: ignore[no-untyped-def]
    """Sort candidates, drop doubles and the hopeless, turn scores into probabilities; how many are left."""
    kept = 0
    best = 0.0
    total = 0.0
    while True:
        # Selection: so few survive that sorting all would do more work.
        top = -1
        for i in range(count):
            if found.score[i] > -math.inf and (top < 0 or found.score[i] > found.score[top]):
                top = i
        if top < 0:
            break
        if kept == 0:
            best = found.score[top]
        elif found.score[top] < best - CUT:
            break
        weight = math.exp(found.score[top] - best)
        found.score[top] = -math.inf
        double = False
        for k in range(kept):
            other = found.order[k]
            if surfaces.link[found.primitive[other]] == surfaces.link[found.primitive[top]]:
                dx = found.point[other, 0] - found.point[top, 0]
                dy = found.point[other, 1] - found.point[top, 1]
                dz = found.point[other, 2] - found.point[top, 2]
                double = double or dx * dx + dy * dy + dz * dz < apart * apart
        if not double:
            found.order[kept] = top
            found.probability[top] = weight
            total += weight
            kept += 1
    link_probability[:] = 0.0
    for k in range(kept):
        i = found.order[k]
        found.probability[i] /= total
        link_probability[surfaces.link[found.primitive[i]]] += found.probability[i]
    return kept


@kernel
def _store(found, row, primitive, shift, result, frame, offset):  # type: ignore[no-untyped-def]
    """Keep one result of `refine`; `shift` is what the link's own energy takes off its evidence."""
    _, log_z, cx, cy, cz, nx, ny, nz, fx, fy, fz, xi, v11, v12, v22 = result
    found.primitive[row] = primitive
    found.score[row] = log_z - shift
    found.point[row, 0], found.point[row, 1], found.point[row, 2] = cx, cy, cz
    found.normal[row, 0], found.normal[row, 1], found.normal[row, 2] = nx, ny, nz
    found.force[row, 0], found.force[row, 1], found.force[row, 2] = fx, fy, fz
    found.torsion[row] = xi
    for i in range(3):
        for k in range(3):
            found.covariance[row, i, k] = (
                frame[i, 1] * (v11 * frame[k, 1] + v12 * frame[k, 2])
                + frame[i, 2] * (v12 * frame[k, 1] + v22 * frame[k, 2])
                + frame[i, 0] * frame[k, 0] * offset * offset
            )


@kernel
def _from_sides(kind, size, radius, R, o, w, L, prior, limit, work):  # type: ignore[no-untyped-def]
    """Best of several starts, one from each side of the body: for a wrench that is too little known to aim with."""
    best = (math.inf, -math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for side in range(6):
        sign = 2.0 * radius if side < 3 else -2.0 * radius
        axis = side % 3
        x, y, z = o[0] + sign * R[0, axis], o[1] + sign * R[1, axis], o[2] + sign * R[2, axis]
        _, cx, cy, cz, nx, ny, nz = nearest(kind, size, R, o, x, y, z)
        result = refine(kind, size, R, o, w, L, prior, limit, cx, cy, cz, nx, ny, nz, work)
        if result[1] > best[1]:
            best = result
    if best[1] > -math.inf:
        # Once more from there, so that the scratch holds the frame of the best.
        best = refine(
            kind, size, R, o, w, L, prior, limit, best[2], best[3], best[4], best[5], best[6], best[7], work
        )
    return best


@kernel
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
        surfaces: Primitives in the frames of their links' bodies.
        touchable: Whether each link can be touched, shape (links,), bool.
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
    place_primitives(surfaces, depth, motion, found)
    count = 0
    least = math.inf
    best = -math.inf
    for link in range(depth.shape[0]):
        if not touchable[link]:
            continue
        w, P, L = hypotheses.wrench[link], hypotheses.covariance[link], hypotheses.information[link]
        own = hypotheses.energy[link]
        for p in range(surfaces.start[link], surfaces.start[link + 1]):
            R, o, kind, size = found.rotation[p], found.origin[p], surfaces.kind[p], surfaces.size[p]
            radius = surfaces.radius[p]
            limit = least + CUT - own
            if aimed:
                if _least_energy(w, P, o, radius, prior.offset) > limit:
                    continue
                result = _aim(kind, size, radius, R, o, w, L, prior, limit, work)
            else:
                result = _from_sides(kind, size, radius, R, o, w, L, prior, limit, work)
            if result[1] > -math.inf:
                _store(found, count, p, own, result, work.frame, prior.offset)
                least = min(least, own + result[0])
                best = max(best, found.score[count])
                count += 1
    _cover(surfaces, found, count, best, prior.offset)
    return _rank(surfaces, found, count, 2.0 * prior.offset, link_probability)


@kernel
def _aim(kind, size, radius, R, o, w, L, prior, limit, work):  # type: ignore[no-untyped-def]
    """Refine from where the wrench axis enters the body, or comes nearest."""
    fx, fy, fz = w[0], w[1], w[2]
    mx = w[3] - o[1] * fz + o[2] * fy
    my = w[4] - o[2] * fx + o[0] * fz
    mz = w[5] - o[0] * fy + o[1] * fx
    _, x, y, z, ux, uy, uz = enter(
        kind,
        size,
        radius,
        R[0, 0] * fx + R[1, 0] * fy + R[2, 0] * fz,
        R[0, 1] * fx + R[1, 1] * fy + R[2, 1] * fz,
        R[0, 2] * fx + R[1, 2] * fy + R[2, 2] * fz,
        R[0, 0] * mx + R[1, 0] * my + R[2, 0] * mz,
        R[0, 1] * mx + R[1, 1] * my + R[2, 1] * mz,
        R[0, 2] * mx + R[1, 2] * my + R[2, 2] * mz,
    )
    cx, cy, cz = turn(R, x, y, z)
    nx, ny, nz = turn(R, ux, uy, uz)
    return refine(kind, size, R, o, w, L, prior, limit, cx + o[0], cy + o[1], cz + o[2], nx, ny, nz, work)
