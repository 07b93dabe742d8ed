"""Candidates from the filter of the place: cells near each other are one candidate."""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.localization.accessibility import accessible_share, clearance
from contactsense.localization.candidate_buffers import MAX_CANDIDATES, Candidates
from contactsense.localization.surface_samples import SurfaceSamples
from contactsense.localization.surface_search import (
    MAX_PROJECTIONS,
    MERGE_DISTANCE,
    MERGE_SIGMAS,
    MIN_RELATIVE_WEIGHT,
    SURFACE_TOLERANCE,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, add, dot, rotate, scale, subtract, tangents, vector
from contactsense.solvers.posterior import Prior
from contactsense.solvers.posterior_mode import ENERGY_CUTOFF
from contactsense.tracking.place_filter import PlaceFilter


@fused_kernel
def score_places(
    places: PlaceFilter,
    samples: SurfaceSamples,
    surfaces: Surfaces,
    depth: np.ndarray,
    motion: Motion,
    candidates: Candidates,
    prior: Prior,
) -> None:
    """Fill `places.score`: the log weights of the cells, lowered where others cover them in this posture.

    Args:
        places: After a block.
        samples: Cells of the surface.
        surfaces: Primitives.
        depth: Number of joints between the base and each link.
        motion: Poses.
        candidates: With the frames of the primitives for these poses.
        prior: Prior of contacts.
    """
    best = -math.inf
    for s in range(places.log_weight.shape[0]):
        best = max(best, places.log_weight[s])
    for s in range(places.log_weight.shape[0]):
        if not places.log_weight[s] > best - ENERGY_CUTOFF:
            places.score[s] = -math.inf
            continue
        p = samples.primitive[s]
        body = depth[surfaces.link[p]]
        above = add(vector(samples.point[s]), scale(prior.clearance, vector(samples.normal[s])))
        x, y, z = add(vector(motion.origin[body]), rotate(motion.rotation[body], above))
        free = clearance(surfaces, candidates, p, x, y, z, 0.0)
        places.score[s] = places.log_weight[s] + math.log(accessible_share(free, prior))


@fused_kernel
def place_of(places: PlaceFilter, samples: SurfaceSamples, s: int) -> Vector:
    """Most probable point of cell s, link frame [m]."""
    t1, t2 = tangents(vector(samples.normal[s]))
    shift = add(scale(places.unknowns[s, 4], t1), scale(places.unknowns[s, 5], t2))
    return add(vector(samples.point[s]), shift)


@fused_kernel
def list_places(
    places: PlaceFilter,
    samples: SurfaceSamples,
    surfaces: Surfaces,
    depth: np.ndarray,
    motion: Motion,
    candidates: Candidates,
    prior: Prior,
    link_probability: np.ndarray,
) -> int:
    """Replace candidates and probabilities of links by those of the filter.

    The probability of "none of these" remains: one minus the sum of `link_probability`.

    Args:
        places, samples, surfaces, depth, motion, candidates, prior: As for `score_places`, after it.
        link_probability: Changed in place.

    Returns:
        Number of candidates.
    """
    score, remaining = places.score, places.remaining
    known, best = 0.0, -math.inf
    for link in range(link_probability.shape[0]):
        known += link_probability[link]
        link_probability[link] = 0.0
    for s in range(score.shape[0]):
        best = max(best, score[s])
    total = 0.0
    for s in range(score.shape[0]):
        remaining[s] = math.exp(score[s] - best)
        total += remaining[s]
    for s in range(score.shape[0]):
        remaining[s] *= known / total
        link_probability[surfaces.link[samples.primitive[s]]] += remaining[s]
    count, highest = 0, 0.0
    for row in range(MAX_CANDIDATES):
        s = _most_probable(remaining)
        if remaining[s] <= max(highest * MIN_RELATIVE_WEIGHT, 0.0):
            break
        _merge(places, samples, surfaces, depth, motion, candidates, prior, s, row)
        highest = max(highest, candidates.probability[row])
        k = count
        while k > 0 and candidates.probability[candidates.order[k - 1]] < candidates.probability[row]:
            candidates.order[k] = candidates.order[k - 1]
            k -= 1
        candidates.order[k] = row
        count += 1
    return count


@fused_kernel
def _most_probable(remaining: np.ndarray) -> int:
    best = 0
    for s in range(remaining.shape[0]):
        if remaining[s] > remaining[best]:
            best = s
    return best


@fused_kernel
def _merge(
    places: PlaceFilter,
    samples: SurfaceSamples,
    surfaces: Surfaces,
    depth: np.ndarray,
    motion: Motion,
    candidates: Candidates,
    prior: Prior,
    s: int,
    row: int,
) -> None:
    """Fill a row of `candidates` with cell s and those of its link near it; they no longer remain."""
    link = surfaces.link[samples.primitive[s]]
    R, o = motion.rotation[depth[link]], vector(motion.origin[depth[link]])
    about = place_of(places, samples, s)
    spread = max(places.variance[s, 0], places.variance[s, 2])
    radius = max(MERGE_DISTANCE, MERGE_SIGMAS * math.sqrt(max(spread, 0.0)))
    force, torsion = _force(places, samples, prior, s)
    C = candidates.covariance[row]
    C[:] = 0.0
    total, mean = 0.0, (0.0, 0.0, 0.0)
    for i in range(places.remaining.shape[0]):
        weight = places.remaining[i]
        if weight == 0.0 or surfaces.link[samples.primitive[i]] != link:
            continue
        e = subtract(place_of(places, samples, i), about)
        if i != s and dot(e, e) > radius * radius:
            continue
        places.remaining[i] = 0.0
        total += weight
        mean = add(mean, scale(weight, e))
        t1, t2 = tangents(vector(samples.normal[i]))
        v11, v12, v22 = places.variance[i, 0], places.variance[i, 1], places.variance[i, 2]
        for a in range(3):
            for b in range(3):
                C[a, b] += weight * (
                    e[a] * e[b]
                    + v11 * t1[a] * t1[b]
                    + v12 * (t1[a] * t2[b] + t2[a] * t1[b])
                    + v22 * t2[a] * t2[b]
                )
    mean = scale(1.0 / total, mean)
    p, point, normal = -1, add(about, mean), (0.0, 0.0, 0.0)
    for _ in range(MAX_PROJECTIONS):
        # At a concave edge, the surface of one primitive may lie inside another.
        distance, p, point, normal = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], point)
        if distance > -SURFACE_TOLERANCE:
            break
    # Second moments about the point on the surface.
    d = subtract(point, about)
    for a in range(3):
        for b in range(3):
            C[a, b] = C[a, b] / total - mean[a] * d[b] - d[a] * mean[b] + d[a] * d[b]
    _rotate_covariance(R, C)
    base, n, f = add(o, rotate(R, point)), rotate(R, normal), rotate(R, force)
    offset = prior.surface_deviation * prior.surface_deviation
    candidates.primitive[row], candidates.probability[row] = p, total
    candidates.torsion[row], candidates.score[row] = torsion, math.log(total)
    for a in range(3):
        candidates.point[row, a], candidates.normal[row, a], candidates.force[row, a] = base[a], n[a], f[a]
        for b in range(3):
            C[a, b] += offset * n[a] * n[b]


@fused_kernel
def _force(places: PlaceFilter, samples: SurfaceSamples, prior: Prior, s: int) -> tuple[Vector, float]:
    """Most probable force in cell s, link frame [N], and torsion [Nm]."""
    n = vector(samples.normal[s])
    t1, t2 = tangents(n)
    x = places.unknowns[s]
    F = prior.force * math.exp(x[0])
    direction = subtract(add(scale(x[1], t1), scale(x[2], t2)), n)
    return scale(F, direction), float(F * x[3])


@fused_kernel
def _rotate_covariance(R: np.ndarray, C: np.ndarray) -> None:
    """C := R C R^T, of symmetric C."""
    a, b, c = rotate(R, vector(C[0])), rotate(R, vector(C[1])), rotate(R, vector(C[2]))
    for j in range(3):
        x, y, z = rotate(R, (a[j], b[j], c[j]))
        C[0, j], C[1, j], C[2, j] = x, y, z
