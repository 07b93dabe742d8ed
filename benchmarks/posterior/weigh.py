"""The posterior over all patches of all links for one measurement, and the answers that are drawn from it."""

import math

import numpy as np

from benchmarks.posterior.evidence import MARGIN, Prior, eliminate, gram, over_force
from benchmarks.posterior.samples import Samples
from contactsense.isolation import Hypotheses
from contactsense.ldl import solve
from kinematics.model import Motion
from robots.compiled import allocating_fused_kernel, fused_kernel

PATCH = 0.02
"""Radius about a place within which probability is gathered for an answer [m]."""
_PICKS = 24


@fused_kernel
def turn(w, L, R, o, T, local_w, local_L):  # type: ignore[no-untyped-def]
    """Bring a wrench and its information matrix from the base frame into a link's.

    Args:
        w, L: About the base origin, base axes, shapes (6,) and (6, 6).
        R, o: Axes (columns) and origin of the link, shapes (3, 3) and (3,).
        T: Scratch: from a wrench in the link's frame to one in the base's, shape (6, 6).
        local_w, local_L: Filled.
    """
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
def weigh(
    samples: Samples,
    touchable: np.ndarray,
    q: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    aimed: bool,
    prior: Prior,
    local_w: np.ndarray,
    local_L: np.ndarray,
    T: np.ndarray,
    M: np.ndarray,
    density: np.ndarray,
    force: np.ndarray,
) -> None:
    """Fill `density` with the log posterior density, not normalised, of every patch and `force` with its
    estimate of the normal force."""
    best = -math.inf
    guess = np.zeros(3)
    links = touchable.shape[0]
    angles = samples.covered.shape[2]
    for link in range(links):
        first, last = samples.start[link], samples.start[link + 1]
        density[first:last] = -math.inf
        if touchable[link] == 0:
            continue
        own = -hypotheses.energy[link]
        R, o = motion.rotation[link], motion.origin[link]
        turn(hypotheses.wrench[link], hypotheses.information[link], R, o, T, local_w, local_L)
        # Standard deviation of the measured force, at most.
        P = hypotheses.covariance[link]
        slack = math.sqrt(P[0, 0] + P[1, 1] + P[2, 2])
        before = _bin(q[link - 1], angles) if link > 0 else -1
        after = _bin(q[link], angles) if link < q.shape[0] else -1
        for s in range(first, last):
            if before >= 0 and samples.covered[s, 0, before]:
                continue
            if after >= 0 and samples.covered[s, 1, after]:
                continue
            n, c = samples.normal[s], samples.point[s]
            if link == 0 and n[2] < -0.5 and c[2] < 0.004:
                # The face that the arm stands on.
                continue
            if aimed:
                push = -(n[0] * local_w[0] + n[1] * local_w[1] + n[2] * local_w[2])
                if push < -5.0 * slack:
                    continue
                guess[0], guess[1], guess[2] = local_w[0], local_w[1], local_w[2]
                start = max(push, prior.low)
            else:
                start = _rough(local_L, local_w, c, n, prior)
                guess[0], guess[1], guess[2] = -start * n[0], -start * n[1], -start * n[2]
            gram(local_L, local_w, c, n, guess, samples.spread[s], prior.offset, M)
            half = eliminate(M)
            value, F = over_force(M, prior, start, best - own + half - MARGIN)
            density[s] = value - half + own
            force[s] = F
            best = max(best, density[s])


@fused_kernel
def _bin(angle, count):  # type: ignore[no-untyped-def]
    turn = (angle + math.pi) / (2.0 * math.pi)
    return min(int((turn - math.floor(turn)) * count), count - 1)


@fused_kernel
def _rough(L, w, c, n, prior):  # type: ignore[no-untyped-def]
    """Normal force of a contact without friction and torsion that fits best [N]."""
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
def normalise(
    samples: Samples, density: np.ndarray, weight: np.ndarray, link_probability: np.ndarray
) -> None:
    """Turn log densities into the probability of each patch, and sum them up for each link."""
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
def densest(density: np.ndarray, first: int, last: int) -> int:
    """Patch of greatest density among some; -1 if none has any."""
    found = -1
    for s in range(first, last):
        if density[s] > -math.inf and (found < 0 or density[s] > density[found]):
            found = s
    return found


@fused_kernel
def gathered(samples, weight, first, last, at):  # type: ignore[no-untyped-def]
    """Probability of the patches within `PATCH` of one."""
    total = 0.0
    x, y, z = samples.point[at, 0], samples.point[at, 1], samples.point[at, 2]
    for s in range(first, last):
        dx, dy, dz = samples.point[s, 0] - x, samples.point[s, 1] - y, samples.point[s, 2] - z
        if weight[s] > 0.0 and dx * dx + dy * dy + dz * dz <= PATCH * PATCH:
            total += weight[s]
    return total


@allocating_fused_kernel
def most_gathered(samples, density, weight, first, last):  # type: ignore[no-untyped-def]
    """Of the densest places that lie apart, the one with the most probability around it; -1 if none."""
    picks = np.full(_PICKS, -1)
    found, most = -1, 0.0
    for i in range(_PICKS):
        top = -1
        for s in range(first, last):
            if not density[s] > -math.inf or (top >= 0 and density[s] <= density[top]):
                continue
            apart = True
            for k in range(i):
                dx = samples.point[s, 0] - samples.point[picks[k], 0]
                dy = samples.point[s, 1] - samples.point[picks[k], 1]
                dz = samples.point[s, 2] - samples.point[picks[k], 2]
                if dx * dx + dy * dy + dz * dz < 0.25 * PATCH * PATCH:
                    apart = False
                    break
            if apart:
                top = s
        if top < 0 or (i > 0 and density[top] < density[picks[0]] - 6.0):
            break
        picks[i] = top
        here = gathered(samples, weight, first, last, top)
        if here > most:
            found, most = top, here
    return found


@allocating_fused_kernel
def displaced(samples, s, F, aimed, prior, local_w, local_L, M, H, g, out):  # type: ignore[no-untyped-def]
    """Expected place on a patch, link frame: its middle and the mean of the displacements along it."""
    n, c = samples.normal[s], samples.point[s]
    guess = np.empty(3)
    for i in range(3):
        guess[i] = local_w[i] if aimed else -F * n[i]
    t = gram(local_L, local_w, c, n, guess, samples.spread[s], prior.offset, M)
    lean = prior.lean[0]
    for i in range(6):
        for k in range(6):
            H[i, k] = M[i, k]
        g[i] = M[7, i] + F * M[6, i]
        if i < 3:
            H[i, i] += 1.0
        elif i < 5:
            H[i, i] += 1.0 / (lean * F) ** 2
        else:
            H[i, i] += 1.0 / (prior.lever * F) ** 2
    done = solve(H, g)[0] < math.inf
    # No farther than the patch reaches: beyond that the next one answers.
    limit = 2.0
    a = min(max(g[0], -limit), limit) * samples.spread[s] if done else 0.0
    b = min(max(g[1], -limit), limit) * samples.spread[s] if done else 0.0
    for i in range(3):
        out[i] = c[i] + a * t[i] + b * t[i + 3]


@allocating_fused_kernel
def mean_about(samples, weight, force, first, last, at, aimed, prior, local_w, local_L, M, H, g, out):  # type: ignore[no-untyped-def]
    """Mean place of the probability within `PATCH` of one patch, link frame."""
    total = 0.0
    place = np.empty(3)
    out[:] = 0.0
    x, y, z = samples.point[at, 0], samples.point[at, 1], samples.point[at, 2]
    least = 1e-3 * weight[at]
    for s in range(first, last):
        dx, dy, dz = samples.point[s, 0] - x, samples.point[s, 1] - y, samples.point[s, 2] - z
        if weight[s] > least and dx * dx + dy * dy + dz * dz <= PATCH * PATCH:
            displaced(samples, s, force[s], aimed, prior, local_w, local_L, M, H, g, place)
            total += weight[s]
            for i in range(3):
                out[i] += weight[s] * place[i]
    for i in range(3):
        out[i] /= total


@fused_kernel
def middle(samples, weight, first, last, motion, probe, owner, place):  # type: ignore[no-untyped-def]
    """The patch among some that is nearest, on average, to wherever the contact may be; -1 if none.

    Args:
        samples, weight: All patches and their probabilities.
        first, last: Patches that may be answered.
        motion: Poses of the links.
        probe, owner, place: Scratch: patches that stand for the posterior, each for the same probability, the
            links that carry them, and where they are; shapes (K,), (K,) and (K, 3).
    """
    count = probe.shape[0]
    total, found, link = 0.0, 0, 0
    for s in range(weight.shape[0]):
        while samples.start[link + 1] <= s:
            link += 1
        total += weight[s]
        while found < count and total > (found + 0.5) / count:
            probe[found], owner[found] = s, link
            c, R, o = samples.point[s], motion.rotation[link], motion.origin[link]
            for i in range(3):
                place[found, i] = o[i] + R[i, 0] * c[0] + R[i, 1] * c[1] + R[i, 2] * c[2]
            found += 1
    best, least = -1, math.inf
    for a in range(found):
        if not first <= probe[a] < last or (a > 0 and probe[a] == probe[a - 1]):
            continue
        away = 0.0
        for b in range(found):
            dx, dy, dz = place[a, 0] - place[b, 0], place[a, 1] - place[b, 1], place[a, 2] - place[b, 2]
            away += math.sqrt(dx * dx + dy * dy + dz * dz)
        if away < least:
            best, least = probe[a], away
    return best
