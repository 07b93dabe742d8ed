"""Multiple-hypothesis filter: sets of contacts that compete over time by their summed log evidence."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.multi_contact.energy_limit import energy_limit
from contactsense.multi_contact.explanations.marginal_probabilities import SAME_POINT_DISTANCE
from contactsense.multi_contact.locator import MultiContactLocator
from contactsense.multi_contact.tracking.tracked_contacts import (
    TrackedContact,
    contacts_in_link_frame,
    predict_known_contacts,
)
from contactsense.runtime.buffers import KernelBuffers
from contactsense.scene import Scene
from contactsense.sensors.usable_sensors import Usable

FORCE_DRIFT = 2.0
"""Standard deviation of the change of each force component between two priors [N]."""
POINT_DRIFT = 5e-4
"""Standard deviation of the change of a point between two priors [m]."""
MAX_HYPOTHESES = 4
"""Maximum number of hypotheses."""
MAX_LOG_ODDS = 8.0
"""Hypotheses whose log odds to the best are worse than this are dropped."""


class Hypothesis(NamedTuple):
    """One set of simultaneous contacts."""

    contacts: tuple[TrackedContact, ...]
    log_probability: float
    """Log probability, up to a constant common to all hypotheses."""
    energy: float = 0.0
    """Energy after the last sample: half the squared residuals and priors, in units of their noise."""


class HypothesisFit(NamedTuple):
    """A hypothesis after a sample."""

    hypothesis: Hypothesis
    rows: np.ndarray
    """One row per contact, see `contactsense.runtime.result_rows`."""
    wrench: np.ndarray
    """Sum of the wrenches, shape (6,) [N, Nm]."""
    covariance: np.ndarray
    """Its covariance, shape (6, 6)."""
    rank: int
    """Number of independent measurements of the wrenches."""


class MultiHypothesisFilter:
    """Explains the samples of a stream by competing hypotheses."""

    def __init__(self, scene: Scene, kernel_buffers: KernelBuffers, locator: MultiContactLocator) -> None:
        """Prepare for the scene and the kernel buffers of a `Localizer`."""
        self._scene, self._constants, self._state, self._locator = (
            scene,
            kernel_buffers.constants,
            kernel_buffers.state,
            locator,
        )
        self.hypotheses: list[Hypothesis] = []

    def energy_limit(self, present: Usable, count: int, drift: float) -> float:
        """`contactsense.multi_contact.energy_limit.energy_limit` of that many contacts."""
        return energy_limit(self._scene, present, count, drift)

    def evaluate(self, present: Usable) -> list[HypothesisFit]:
        """The hypotheses after this sample, the most probable first; the filter itself is not changed."""
        fits = []
        explanations = self._locator.explanations
        for hypothesis in self.hypotheses:
            known = predict_known_contacts(self._state.motion, hypothesis.contacts, 0.0)
            listed, rank = self._locator.fit(present, len(known), known, FORCE_DRIFT, self._scene.bandwidth)
            if listed > 0:
                row = int(explanations.order[0])
                after = self._posterior_hypothesis(hypothesis, row, 0.0)
                wrench, covariance = (
                    explanations.wrench[row].copy(),
                    explanations.wrench_covariance[row].copy(),
                )
                fits.append(HypothesisFit(after, self._locator.best_rows(), wrench, covariance, rank))
        return sorted(fits, key=lambda fit: -fit.hypothesis.log_probability)

    def explain(
        self,
        present: Usable,
        before: Sequence[Hypothesis],
        contacts: int,
        drift: float,
        slide: float = 0.0,
        odds: float = 0.0,
    ) -> list[Hypothesis]:
        """Sets of exactly `contacts` contacts after this sample that include those of `before`, the best
        first.

        Args:
            present: Which sensors can be used.
            before: Hypotheses before the sample.
            contacts: Number of contacts.
            drift: Standard deviation of the change of each component of their forces [N].
            slide: Standard deviation of the change of their points [m].
            odds: Log prior odds of this change.
        """
        after = []
        explanations = self._locator.explanations
        for hypothesis in before:
            known = predict_known_contacts(self._state.motion, hypothesis.contacts, slide)
            listed, _ = self._locator.fit(present, contacts, known, drift, self._scene.bandwidth)
            after += [
                self._posterior_hypothesis(hypothesis, int(row), odds)
                for row in explanations.order[:listed]
                if explanations.contacts[row] == contacts
            ]
        return sorted(after, key=lambda hypothesis: -hypothesis.log_probability)

    def with_further_contact(self, present: Usable, before: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Sets with one more contact; the forces of the others either drift or are free."""
        count = len(before[0].contacts) + 1
        after = self.explain(present, before, count, FORCE_DRIFT) + self.explain(
            present, before, count, math.inf
        )
        return sorted(after, key=lambda hypothesis: -hypothesis.log_probability)

    def set_prior(self, after: Sequence[Hypothesis]) -> None:
        """Make the best of these sets the hypotheses of the filter: priors of the next samples."""
        best = max(hypothesis.log_probability for hypothesis in after)
        self.hypotheses = []
        for hypothesis in sorted(after, key=lambda hypothesis: -hypothesis.log_probability):
            if hypothesis.log_probability < best - MAX_LOG_ODDS or len(self.hypotheses) == MAX_HYPOTHESES:
                break
            if not any(self._same_contacts(hypothesis, other) for other in self.hypotheses):
                drift = POINT_DRIFT * POINT_DRIFT * np.eye(3)
                contacts = tuple(c._replace(covariance=c.covariance + drift) for c in hypothesis.contacts)
                self.hypotheses.append(Hypothesis(contacts, hypothesis.log_probability - best))

    def _posterior_hypothesis(self, before: Hypothesis, row: int, odds: float) -> Hypothesis:
        """Hypothesis from a row of the explanations, with the accumulated log probability."""
        explanations = self._locator.explanations
        return Hypothesis(
            contacts_in_link_frame(self._constants, self._state.motion, explanations, row),
            before.log_probability + odds + float(explanations.score[row]),
            float(explanations.energy[row]),
        )

    @staticmethod
    def _same_contacts(one: Hypothesis, other: Hypothesis) -> bool:
        """Whether two hypotheses have the same contacts."""
        return all(
            a.body == b.body and float(np.linalg.norm(a.point - b.point)) < SAME_POINT_DISTANCE
            for a, b in zip(one.contacts, other.contacts, strict=True)
        )


def without_contact(hypotheses: Sequence[Hypothesis], i: int) -> list[Hypothesis]:
    """The hypotheses without contact i."""
    return [
        hypothesis._replace(contacts=hypothesis.contacts[:i] + hypothesis.contacts[i + 1 :])
        for hypothesis in hypotheses
    ]
