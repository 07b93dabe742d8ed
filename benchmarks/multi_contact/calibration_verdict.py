"""What one estimate of several contacts stated, and what of it was correct."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense import Contact, Explanation
from contactsense.benchmarks.accuracy.calibration import NEAR, REGION
from contactsense.benchmarks.statistics.credible_regions import explains, level, mixture, samples

_SHIFT = 97
"""Offset between the draws of one contact and the next one of the same explanation."""


class Verdict(NamedTuple):
    """What one estimate stated, and what was correct."""

    answer: tuple[float, bool, float]
    """Probability of the best explanation, whether it is the true one, and how probable that is for truths
    drawn from the explanations: where two overlap, the truth of one may be nearer to the other."""
    in_region: tuple[bool, ...]
    """Whether the region of highest density with the probability `REGION` contains the truth, of each
    contact."""
    listed: float
    """Sum of the probabilities of all explanations."""
    error: float
    """Distance of the best explanation's contact that is farthest from its truth [m]; infinite with another
    number of contacts."""


def verdict(
    explanations: Sequence[Explanation], links: np.ndarray, points: np.ndarray, ordered: bool
) -> Verdict:
    """Compare one estimate with the truth.

    Args:
        explanations: Sets of contacts, most probable first; at least one.
        links: Indices of the touched links, shape (K,).
        points: True places, base frame, shape (K, 3) [m].
        ordered: Whether the contacts of each explanation are in the order of the truth; else both are put in
            the order of their links.
    """
    sets = [tuple(e.contacts) for e in explanations]
    if not ordered:
        sets = [tuple(sorted(contacts, key=lambda contact: contact.link_index)) for contacts in sets]
        order = np.argsort(links, kind="stable")
        links, points = links[order], points[order]
    probability = np.array([e.probability for e in explanations])
    drawn = [is_best(sets, *_draws(contacts)).mean() for contacts in sets]
    is_right = bool(is_best(sets, links, points[None])[0])
    in_region = []
    for i, (link, point) in enumerate(zip(links, points, strict=True)):
        there = [k for k, contacts in enumerate(sets) if i < len(contacts)]
        stated = mixture([sets[k][i] for k in there])._replace(weight=probability[there])
        in_region.append(level(stated, int(link), point) < REGION)
    return Verdict(
        answer=(float(probability[0]), is_right, float(probability @ np.array(drawn))),
        in_region=tuple(in_region),
        listed=float(probability.sum()),
        error=_worst_error(sets[0], points),
    )


def _worst_error(contacts: tuple[Contact, ...], points: np.ndarray) -> float:
    if len(contacts) != len(points):
        return float("inf")
    found = np.array([contact.point_base for contact in contacts])
    return float(np.linalg.norm(found - points, axis=1).max())


def _draws(contacts: tuple[Contact, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Links of an explanation's contacts, shape (K,), and equally probable places, shape (N, K, 3)."""
    stated = mixture(contacts)
    points = samples(stated)
    return stated.link, np.stack(
        [np.roll(points[i], i * _SHIFT, axis=0) for i in range(len(contacts))], axis=1
    )


def is_best(sets: Sequence[tuple[Contact, ...]], links: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether the first explanation is the true one, for N truths.

    It has the right links, each place is not farther than `NEAR` or inside the 99.9 % ellipse, and no other
    explanation with these links is nearer, in the contact farthest from it.

    Args:
        sets: Explanations.
        links: Of the truths, shape (K,).
        points: Shape (N, K, 3) [m].
    """
    away = np.full((len(sets), len(points)), np.inf)
    for k, contacts in enumerate(sets):
        if [contact.link_index for contact in contacts] == list(links):
            mean = np.array([contact.point_base for contact in contacts])
            away[k] = np.linalg.norm(points - mean, axis=2).max(axis=1)
    reached = np.isfinite(away[0])
    if reached.any():
        stated = mixture(sets[0])
        for i, contact in enumerate(sets[0]):
            near = np.linalg.norm(points[:, i] - contact.point_base, axis=1) <= NEAR
            reached &= near | explains(stated, contact.link_index, points[:, i])[i]
    return np.asarray(reached & (np.argmin(away, axis=0) == 0))
