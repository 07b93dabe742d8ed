"""Fixed place and moving paths from one starting point: the paths that are tried, and their mixture.

The number of knots grows as long as it adds information. A path of three knots has the second one at several
times, as a slide may begin, end or change its velocity at any time; further ones divide the intervals of the
best path in two.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.service.analysis.smoothing.goodness_of_fit import is_good_fit
from contactsense.service.analysis.smoothing.place_search import LinkMeasurement, Place, PlaceSearch
from contactsense.solvers.posterior.contact_prior import Prior

SPEEDS = 0.01, 0.03, 0.1
"""Standard deviations of the velocity at which contacts slide, in each tangential direction [m/s].
All are equally probable: some contacts slide much faster than others."""
MOST_KNOTS = 12
"""Maximum number of knots of a path."""
KNOT_TIME = 0.1
"""Minimum time between knots, except for the first two [s]."""
SPLITS = 5
"""Number of times at which a path of three knots may have the second one."""
RULED_OUT = 3.0
"""A speed whose best path has a logarithm of the evidence that is lower by this much than that of another
speed is not tried with more knots."""


def moving_paths(
    surfaces: Surfaces,
    link: int,
    prior: Prior,
    measured: LinkMeasurement,
    start: np.ndarray,
    log_evidence: float = -math.inf,
) -> Iterator[list[Place]]:
    """Moving paths with increasing numbers of knots, all of the same number together.

    Args:
        surfaces: Primitives of all links.
        link: The link.
        prior: Prior of contacts.
        measured: Measurements on that link.
        start: Knots of the first guess at equal times, shape (K, 3), one for a fixed place [m].
        log_evidence: That of the fixed place; a path must be better to be divided further.
    """
    times, path = np.linspace(measured.t[0], measured.t[-1], len(start)), start
    tried, speeds, best = [measured.t[[0, -1]]], SPEEDS, log_evidence
    while tried and len(tried[0]) <= MOST_KNOTS and len(measured.t) >= 2 * len(tried[0]):
        found = []
        for at, speed in product(tried, speeds):
            guess = np.column_stack([np.interp(at, times, column) for column in path.T])
            place = PlaceSearch(surfaces, link, prior, measured, at, speed).run(guess)
            if place is not None:
                found.append((place.log_evidence, speed, at, place))
        if not found:
            return
        yield [place for *_, place in found]
        most, _, times, place = max(found, key=lambda one: one[0])
        if most < best:
            return
        best, path = most, place.knots
        tried = _with_another_knot(times)
        speeds = tuple({speed for evidence, speed, *_ in found if evidence > most - RULED_OUT})


def mixture(paths: Sequence[Sequence[Place]]) -> Place | None:
    """One place from all paths that fit: mean and covariance over them, weighted by their evidence; None if
    none fits. With `paths` of each number of knots together, a fixed and a moving place have equal prior
    probability, as have all numbers of knots of a moving one, and all paths of one number."""
    moving = max(sum(alike[0].sliding for alike in paths), 1)
    listed, logarithms = [], []
    for alike in paths:
        share = 2.0 * len(alike) * (moving if alike[0].sliding else 1)
        for path in filter(_fits, alike):
            listed.append(path)
            logarithms.append(path.log_evidence - math.log(share))
    if not listed:
        return None
    evidence = np.array(logarithms)
    weight = np.exp(evidence - evidence.max())
    total = weight.sum()
    weight /= total
    point = np.einsum("p,pwi->wi", weight, [path.point for path in listed])
    away = np.array([path.point for path in listed]) - point
    covariance = np.einsum("p,pwik->wik", weight, [path.covariance for path in listed])
    covariance += np.einsum("p,pwi,pwk->wik", weight, away, away)
    return replace(
        listed[int(np.argmax(weight))],
        log_evidence=float(evidence.max() + np.log(total)),
        point=point,
        covariance=covariance,
    )


def _fits(place: Place) -> bool:
    """Whether one contact at that place explains all windows; it does not if there were two successive
    contacts."""
    return is_good_fit(2.0 * place.energy, place.freedom)


def _with_another_knot(times: np.ndarray) -> list[np.ndarray]:
    """Times of the knots with another one, shape (K + 1,) each."""
    if len(times) == 2:
        added = np.linspace(times[0], times[-1], SPLITS + 2)[1:-1]
    else:
        added = 0.5 * (times[1:] + times[:-1])
    together = [np.sort(np.append(times, one)) for one in added]
    return [at for at in together if np.diff(at).min() >= KNOT_TIME]
