"""The posterior over all surface patches of all links for one measurement, and point estimates from it."""

import math
from typing import NamedTuple

import numpy as np

from contactsense.benchmarks.posterior.evidence import EVIDENCE_CUTOFF, Prior, eliminate, gram, over_force
from contactsense.benchmarks.posterior.samples import Samples
from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.model import Motion
from contactsense.robots.jit.kernel import allocating_fused_kernel, fused_kernel

RADIUS = 0.02
"""Radius within which the probability of an estimate is summed [m]."""
_MAX_PEAKS = 24


class LinkMeasurement(NamedTuple):
    """The measurement in the frame of one link, and scratch for its patches."""

    wrench: np.ndarray
    """About the link's origin, link axes, shape (6,) [N, Nm]."""
    information: np.ndarray
    """Its information matrix, shape (6, 6)."""
    transform: np.ndarray
    """Scratch: map of a wrench from the link frame to the base frame, shape (6, 6)."""
    gram: np.ndarray
    """Scratch, see `contactsense.benchmarks.posterior.evidence.gram`, shape (8, 8)."""
    H: np.ndarray
    """Scratch: information of the six unknowns of a patch, shape (6, 6)."""
    g: np.ndarray
    """Scratch: right-hand side of their equations, then the solution, shape (6,)."""


def empty_measurement() -> LinkMeasurement:
    """Zeroed arrays."""
    return LinkMeasurement(*(np.zeros(shape) for shape in (6, (6, 6), (6, 6), (8, 8), (6, 6), 6)))


class Probes(NamedTuple):
    """K patches that represent the posterior with equal probability."""

    patch: np.ndarray
    """Shape (K,), int64."""
    link: np.ndarray
    """Their links, shape (K,), int64."""
    point: np.ndarray
    """Their places in the base frame, shape (K, 3) [m]."""


@fused_kernel
def wrench_in_link_frame(
    w: np.ndarray, L: np.ndarray, R: np.ndarray, o: np.ndarray, out: LinkMeasurement
) -> None:
    """Transform a wrench and its information matrix from the base frame to the frame of a link.

    Args:
        w, L: About the base origin, base axes, shapes (6,) and (6, 6).
        R, o: Rotation and origin of the link, shapes (3, 3) and (3,).
        out: Wrench, information and transform are filled.
    """
    T, local_w, local_L = out.transform, out.wrench, out.information
    for k in range(3):
        a, b, c = R[0, k], R[1, k], R[2, k]
        for i in range(3):
            T[i, k] = R[i, k]
            T[i, k + 3] = 0.0
            T[i + 3, k + 3] = R[i, k]
        T[3, k], T[4, k], T[5, k] = o[1] * c - o[2] * b, o[2] * a - o[0] * c, o[0] * b - o[1] * a
    x, y, z = o[0], o[1], o[2]
    mx, my, mz = w[3] - y * w[2] + z * w[1], w[4] - z * w[0] + x * w[2], w[5] - x * w[1] + y * w[0]
    for k in range(3):
        local_w[k] = R[0, k] * w[0] + R[1, k] * w[1] + R[2, k] * w[2]
        local_w[k + 3] = R[0, k] * mx + R[1, k] * my + R[2, k] * mz
    for i in range(6):
        for k in range(i + 1):
            total = 0.0
            for a in range(6):
                for b in range(6):
                    total += T[a, i] * L[a, b] * T[b, k]
            local_L[i, k] = total
            local_L[k, i] = total


@allocating_fused_kernel
def evaluate_patches(
    samples: Samples,
    touchable: np.ndarray,
    q: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    wrench_measured: bool,
    prior: Prior,
    local: LinkMeasurement,
    density: np.ndarray,
    force: np.ndarray,
) -> None:
    """Fill `density` with the unnormalized log posterior density of every patch, and `force` with its
    normal force."""
    best = -math.inf
    guess = np.zeros(3)
    local_w, local_L, M = local.wrench, local.information, local.gram
    links = touchable.shape[0]
    angles = samples.covered.shape[2]
    for link in range(links):
        first, last = samples.start[link], samples.start[link + 1]
        density[first:last] = -math.inf
        if touchable[link] == 0:
            continue
        link_log_evidence = -hypotheses.energy[link]
        R, o = motion.rotation[link], motion.origin[link]
        wrench_in_link_frame(hypotheses.wrench[link], hypotheses.information[link], R, o, local)
        # Upper bound of the standard deviation of the measured force.
        P = hypotheses.covariance[link]
        force_deviation = math.sqrt(P[0, 0] + P[1, 1] + P[2, 2])
        proximal_bin = _bin(q[link - 1], angles) if link > 0 else -1
        distal_bin = _bin(q[link], angles) if link < q.shape[0] else -1
        for s in range(first, last):
            if proximal_bin >= 0 and samples.covered[s, 0, proximal_bin]:
                continue
            if distal_bin >= 0 and samples.covered[s, 1, distal_bin]:
                continue
            n, c = samples.normal[s], samples.point[s]
            if link == 0 and n[2] < -0.5 and c[2] < 0.004:
                # The mounting face.
                continue
            if wrench_measured:
                normal_force = -(n[0] * local_w[0] + n[1] * local_w[1] + n[2] * local_w[2])
                if normal_force < -5.0 * force_deviation:
                    continue
                guess[0], guess[1], guess[2] = local_w[0], local_w[1], local_w[2]
                start = max(normal_force, prior.low)
            else:
                start = _initial_force(local_L, local_w, c, n, prior)
                guess[0], guess[1], guess[2] = -start * n[0], -start * n[1], -start * n[2]
            gram(local_L, local_w, c, n, guess, samples.spread[s], prior.surface_deviation, M)
            half_log_det = eliminate(M)
            value, F = over_force(M, prior, start, best - link_log_evidence + half_log_det - EVIDENCE_CUTOFF)
            density[s] = value - half_log_det + link_log_evidence
            force[s] = F
            best = max(best, density[s])


@fused_kernel
def _bin(angle: float, count: int) -> int:
    turns = (angle + math.pi) / (2.0 * math.pi)
    return min(int((turns - math.floor(turns)) * count), count - 1)


@fused_kernel
def _initial_force(L: np.ndarray, w: np.ndarray, c: np.ndarray, n: np.ndarray, prior: Prior) -> float:
    """Least-squares normal force of a contact without friction and torsion [N]."""
    u = (
        -n[0],
        -n[1],
        -n[2],
        c[2] * n[1] - c[1] * n[2],
        c[0] * n[2] - c[2] * n[0],
        c[1] * n[0] - c[0] * n[1],
    )
    uu, uw = 0.0, 0.0
    for i in range(6):
        for k in range(6):
            uu += u[i] * L[i, k] * u[k]
            uw += u[i] * L[i, k] * w[k]
    return min(max(uw / uu, prior.low), prior.high)


@fused_kernel
def normalize(
    samples: Samples, density: np.ndarray, weight: np.ndarray, link_probability: np.ndarray
) -> None:
    """Normalize log densities to the probability of each patch, and sum them for each link."""
    top = -math.inf
    for s in range(density.shape[0]):
        top = max(top, density[s])
    total = 0.0
    for s in range(density.shape[0]):
        weight[s] = samples.area[s] * math.exp(density[s] - top) if density[s] > -math.inf else 0.0
        total += weight[s]
    link_probability[:] = 0.0
    if not total > 0.0:
        return
    for link in range(link_probability.shape[0]):
        for s in range(samples.start[link], samples.start[link + 1]):
            weight[s] /= total
            link_probability[link] += weight[s]


@fused_kernel
def probability_near(samples: Samples, weight: np.ndarray, first: int, last: int, patch: int) -> float:
    """Probability of the patches within `RADIUS` of one."""
    total = 0.0
    x, y, z = samples.point[patch, 0], samples.point[patch, 1], samples.point[patch, 2]
    for s in range(first, last):
        dx, dy, dz = samples.point[s, 0] - x, samples.point[s, 1] - y, samples.point[s, 2] - z
        if weight[s] > 0.0 and dx * dx + dy * dy + dz * dz <= RADIUS * RADIUS:
            total += weight[s]
    return total


@allocating_fused_kernel
def most_probable_patch(
    samples: Samples, density: np.ndarray, weight: np.ndarray, first: int, last: int
) -> int:
    """Of the highest separate peaks of the density, the one with the most probability nearby; -1 if none."""
    peaks = np.full(_MAX_PEAKS, -1)
    best, highest = -1, 0.0
    for i in range(_MAX_PEAKS):
        top = -1
        for s in range(first, last):
            if not density[s] > -math.inf or (top >= 0 and density[s] <= density[top]):
                continue
            is_separate = True
            for k in range(i):
                dx = samples.point[s, 0] - samples.point[peaks[k], 0]
                dy = samples.point[s, 1] - samples.point[peaks[k], 1]
                dz = samples.point[s, 2] - samples.point[peaks[k], 2]
                if dx * dx + dy * dy + dz * dz < 0.25 * RADIUS * RADIUS:
                    is_separate = False
                    break
            if is_separate:
                top = s
        if top < 0 or (i > 0 and density[top] < density[peaks[0]] - 6.0):
            break
        peaks[i] = top
        probability = probability_near(samples, weight, first, last, top)
        if probability > highest:
            best, highest = top, probability
    return best


@allocating_fused_kernel
def mean_on_patch(
    samples: Samples,
    s: int,
    F: float,
    wrench_measured: bool,
    prior: Prior,
    local: LinkMeasurement,
    out: np.ndarray,
) -> None:
    """Expected point on a patch, link frame: its centre plus the mean displacement along it."""
    M, H, g = local.gram, local.H, local.g
    n, c = samples.normal[s], samples.point[s]
    guess = np.empty(3)
    for i in range(3):
        guess[i] = local.wrench[i] if wrench_measured else -F * n[i]
    t = gram(local.information, local.wrench, c, n, guess, samples.spread[s], prior.surface_deviation, M)
    for i in range(6):
        for k in range(6):
            H[i, k] = M[i, k]
        g[i] = M[7, i] + F * M[6, i]
        if i < 3:
            H[i, i] += 1.0
        elif i < 5:
            H[i, i] += 1.0 / (prior.friction_ratio * F) ** 2
        else:
            H[i, i] += 1.0 / (prior.torsion_lever * F) ** 2
    solved = ldl_solve(H, g)[0] < math.inf
    # At most as far as the patch extends.
    limit = 2.0
    a = min(max(g[0], -limit), limit) * samples.spread[s] if solved else 0.0
    b = min(max(g[1], -limit), limit) * samples.spread[s] if solved else 0.0
    for i in range(3):
        out[i] = c[i] + a * t[i] + b * t[i + 3]


@allocating_fused_kernel
def mean_near(
    samples: Samples,
    weight: np.ndarray,
    force: np.ndarray,
    first: int,
    last: int,
    patch: int,
    wrench_measured: bool,
    prior: Prior,
    local: LinkMeasurement,
    out: np.ndarray,
) -> None:
    """Mean point of the probability within `RADIUS` of one patch, link frame."""
    total = 0.0
    point = np.empty(3)
    out[:] = 0.0
    x, y, z = samples.point[patch, 0], samples.point[patch, 1], samples.point[patch, 2]
    min_weight = 1e-3 * weight[patch]
    for s in range(first, last):
        dx, dy, dz = samples.point[s, 0] - x, samples.point[s, 1] - y, samples.point[s, 2] - z
        if weight[s] > min_weight and dx * dx + dy * dy + dz * dz <= RADIUS * RADIUS:
            mean_on_patch(samples, s, force[s], wrench_measured, prior, local, point)
            total += weight[s]
            for i in range(3):
                out[i] += weight[s] * point[i]
    for i in range(3):
        out[i] /= total


@fused_kernel
def median_patch(
    samples: Samples, weight: np.ndarray, first: int, last: int, motion: Motion, probes: Probes
) -> int:
    """The patch in a range with the lowest expected distance to the contact; -1 if none.

    Args:
        samples, weight: All patches and their probabilities.
        first, last: Range of the patches that may be returned.
        motion: Poses of the links.
        probes: Filled.
    """
    probe, owner, point = probes.patch, probes.link, probes.point
    count = probe.shape[0]
    total, filled, link = 0.0, 0, 0
    for s in range(weight.shape[0]):
        while samples.start[link + 1] <= s:
            link += 1
        total += weight[s]
        while filled < count and total > (filled + 0.5) / count:
            probe[filled], owner[filled] = s, link
            c, R, o = samples.point[s], motion.rotation[link], motion.origin[link]
            for i in range(3):
                point[filled, i] = o[i] + R[i, 0] * c[0] + R[i, 1] * c[1] + R[i, 2] * c[2]
            filled += 1
    best, lowest_distance = -1, math.inf
    for a in range(filled):
        if not first <= probe[a] < last or (a > 0 and probe[a] == probe[a - 1]):
            continue
        distance = 0.0
        for b in range(filled):
            dx, dy, dz = point[a, 0] - point[b, 0], point[a, 1] - point[b, 1], point[a, 2] - point[b, 2]
            distance += math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance < lowest_distance:
            best, lowest_distance = probe[a], distance
    return best
