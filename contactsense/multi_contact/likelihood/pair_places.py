"""Where two contacts on two links are, by the sum over all pairs of samples: the likeliest pair, and how far
the others are from it."""

import math

import numpy as np

from contactsense.multi_contact.memory.buffers import SeedingBuffers
from contactsense.multi_contact.memory.pair_layout import PAIRS
from contactsense.multi_contact.memory.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES


@fused_kernel
def find_likeliest_pair(
    seed_samples: SeedSamples, own: int, link: int, seeding: SeedingBuffers
) -> tuple[int, int]:
    """The likeliest pair of samples on two links that push.

    Args:
        seed_samples: The samples.
        own, link: The links, the one farther from the base first.
        seeding: After `contactsense.multi_contact.seeding.pair_seeding.seed_pairs` of two contacts.

    Returns:
        Their places among the coarse samples, lanes of blocks; -1 if no pair pushes.
    """
    chosen, reference = seed_samples.coarse, seeding.pair_gain[own, link]
    highest, one, other = 0.0, -1, -1
    for b in range(chosen.link.shape[0]):
        if chosen.link[b] != own:
            continue
        for d in range(b + 1):
            if chosen.link[d] != link:
                continue
            likelihood, best, at = seeding.pair_likelihood[b, d], 0.0, 0
            scale = math.exp(seeding.pair_reference[b, d] - reference)
            for i in range(PAIRS if scale > 0.0 else 0):
                if likelihood[i] > best:
                    best, at = likelihood[i], i
            if scale * best > highest:
                highest, one, other = scale * best, b * LANES + at // LANES, d * LANES + at % LANES
    return one, other


@fused_kernel
def fill_place_likelihood(
    seed_samples: SeedSamples, own: int, link: int, pair: tuple[int, int], seeding: SeedingBuffers
) -> None:
    """Fill `seeding.place_likelihood`.

    Of two contacts on one link, no measurement tells which is which. The first is the one that is farther in
    the direction from the second place of the likeliest pair to the first one: so both are nearest to that
    pair, by the sum of the squared distances.

    Args:
        seed_samples, own, link, seeding: As for `find_likeliest_pair`.
        pair: What that returned; of no account on different links.
    """
    chosen, place = seed_samples.coarse, seeding.place_likelihood
    reference, far, total = seeding.pair_gain[own, link], seeding.sample_order, 0.0
    place[:] = 0.0
    p, q = (
        seeding.point_normal[sample_at(seed_samples, pair[0])],
        seeding.point_normal[sample_at(seed_samples, pair[1])],
    )
    for i in range(far.shape[0] if own == link else 0):
        c = seeding.point_normal[sample_at(seed_samples, i)]
        far[i] = (p[0] - q[0]) * c[0] + (p[1] - q[1]) * c[1] + (p[2] - q[2]) * c[2]
    for b in range(chosen.link.shape[0]):
        if chosen.link[b] != own:
            continue
        for d in range(b + 1):
            if chosen.link[d] != link:
                continue
            likelihood = seeding.pair_likelihood[b, d]
            scale = math.exp(seeding.pair_reference[b, d] - reference)
            for j in range(PAIRS if scale > 0.0 else 0):
                x, i, k = scale * abs(likelihood[j]), b * LANES + j // LANES, d * LANES + j % LANES
                total += x
                swapped = own == link and far[k] > far[i]
                place[0, k if swapped else i] += x
                place[1, i if swapped else k] += x
    for i in range(place.shape[1]):
        place[0, i] /= total
        place[1, i] /= total


@fused_kernel
def sample_at(seed_samples: SeedSamples, i: int) -> int:
    """The sample at a place among the coarse ones."""
    return int(seed_samples.coarse.sample[i // LANES, i % LANES])


@fused_kernel
def fill_place_covariance(
    seed_samples: SeedSamples,
    link: int,
    contact: int,
    point: np.ndarray,
    surface_deviation: float,
    seeding: SeedingBuffers,
    out: np.ndarray,
) -> None:
    """Mean squared deviation of a contact's place from a point, over all samples and their cells.

    Args:
        seed_samples, seeding: After `fill_place_likelihood`.
        link: Its link.
        contact: 0 or 1: the one on the farther link, or the other one.
        point: The point, base frame, shape (>= 3,) [m].
        surface_deviation: Standard deviation of the surface along its normal [m].
        out: Filled, shape (3, 3) [m^2].
    """
    chosen, likelihood = seed_samples.coarse, seeding.place_likelihood[contact]
    cell = seed_samples.spread[link] * seed_samples.spread[link]
    flat = surface_deviation * surface_deviation - cell
    for k in range(3):
        for a in range(3):
            out[k, a] = cell if k == a else 0.0
    for d in range(chosen.link.shape[0]):
        if chosen.link[d] != link:
            continue
        for e in range(chosen.filled[d]):
            w, s = likelihood[d * LANES + e], seeding.point_normal[chosen.sample[d, e]]
            x, y, z = s[0] - point[0], s[1] - point[1], s[2] - point[2]
            u, v, n = s[3], s[4], s[5]
            out[0, 0] += w * (x * x + flat * u * u)
            out[1, 0] += w * (y * x + flat * v * u)
            out[1, 1] += w * (y * y + flat * v * v)
            out[2, 0] += w * (z * x + flat * n * u)
            out[2, 1] += w * (z * y + flat * n * v)
            out[2, 2] += w * (z * z + flat * n * n)
    out[0, 1], out[0, 2], out[1, 2] = out[1, 0], out[2, 0], out[2, 1]
