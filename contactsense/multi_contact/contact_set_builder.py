"""Builds the `Estimate` of several simultaneous contacts from result rows."""

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from contactsense.multi_contact.buffers import MAX_CONTACTS
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.result_rows import LINK, POINT_BASE, PROBABILITY, WIDTH
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, Explanation, Phase, Status

SAME_POINT_DISTANCE = 0.02
"""Contacts of two explanations on one link within this distance count as the same [m]."""
UNRESOLVED_DEVIATION = 0.0225
"""A point with a larger standard deviation is reported as unresolved [m]."""
POINT_UNKNOWNS, FORCE_UNKNOWNS = 2, 3
"""Unknowns of a contact that the priors do not determine: point (2) and force (3)."""


class ContactSetBuilder:
    """Builds estimates of several simultaneous contacts for one scene."""

    def __init__(self, scene: Scene, estimate_builder: EstimateBuilder) -> None:
        """`estimate_builder` builds the single contacts."""
        self._estimate_builder = estimate_builder
        self._names = scene.link_names
        self._clear = scene.clear
        # Compiled before the first sample that several contacts explain.
        state_marginal_probabilities(np.zeros((0, WIDTH)), np.zeros(0, dtype=np.int64), np.zeros(0))

    def sets(
        self,
        t: float,
        rows_of_sets: Sequence[np.ndarray],
        wrench: np.ndarray,
        covariance: np.ndarray,
        rank: int,
        known_count: int,
        reason: str = "",
        tracked: Sequence[tuple[int, Phase]] = (),
        events: tuple[Event, ...] = (),
    ) -> Estimate:
        """Estimate from sets of contacts, the most probable first.

        Args:
            t: Time of the sample [s].
            rows_of_sets: One array per set, with a row per contact as in
                `contactsense.runtime.result_rows`; the probability in each row is that of the whole set. The
                contacts keep views of a copy, with their own probabilities.
            wrench, covariance: Sum of the wrenches of the first set, shape (6,), and its covariance, (6,
                6).
            rank: Number of independent measurements of the first set's wrenches.
            known_count: Number of contacts whose points were known before.
            reason: Why the estimate is `degraded`, empty if it is not.
            tracked: Number and phase of each contact of a stream, the same in all sets.
            events: Onsets, holds and releases to report.
        """
        if not rows_of_sets:
            why = "something acts on the arm, but no pushes on touchable links explain it"
            return self._estimate_builder.without_contacts(
                t, "degraded" if reason else "ambiguous", f"{reason}; {why}".strip("; ")
            )
        labels = tracked or [(0, "")] * MAX_CONTACTS
        probabilities = [float(rows[0, PROBABILITY]) for rows in rows_of_sets]
        counts = [len(rows) for rows in rows_of_sets]
        stated = np.concatenate(rows_of_sets)
        state_marginal_probabilities(
            stated, np.repeat(np.arange(len(counts)), counts), np.array(probabilities)
        )
        ends = accumulate(counts)
        rows_of_sets = [stated[end - count : end] for end, count in zip(ends, counts, strict=True)]
        sets = tuple(
            [
                Explanation(
                    tuple(
                        [
                            self._estimate_builder.contact(row, *label)
                            for row, label in zip(rows, labels, strict=False)
                        ]
                    ),
                    probability,
                )
                for rows, probability in zip(rows_of_sets, probabilities, strict=True)
            ]
        )
        best = sets[0]
        status: Status = "multiple"
        if len(best.contacts) == 1:
            status = "contact" if best.probability >= self._clear else "ambiguous"
        link_probability = np.zeros(len(self._names))
        for explanation in sets:
            for link in {contact.link_index for contact in explanation.contacts}:
                link_probability[link] += explanation.probability
        parts = [reason] if reason else []
        if len(best.contacts) > 1:
            parts += self._unresolved(best.contacts, rank, known_count)
            if best.probability < self._clear:
                parts.append(
                    f"other explanations are not clearly worse ({best.probability:.0%} for this one)"
                )
        return Estimate(
            t,
            "degraded" if reason else status,
            best.contacts,
            link_probability,
            wrench.copy(),
            covariance.copy(),
            max(1.0 - sum(e.probability for e in sets), 0.0),
            "; ".join(parts),
            events,
            sets,
            self._estimate_builder.detectable,
        )

    @staticmethod
    def _unresolved(contacts: Sequence[Contact], rank: int, known_count: int) -> list[str]:
        """Messages about what the sensors cannot resolve of these contacts."""
        parts = []
        links = [contact.link for contact in contacts]
        shared_links = [name for name in dict.fromkeys(links) if links.count(name) > 1]
        parts += [f"of the contacts on {name} the sensors measure the sum only" for name in shared_links]
        needed = FORCE_UNKNOWNS * len(contacts) + POINT_UNKNOWNS * (len(contacts) - known_count)
        if rank < needed:
            parts.append(
                f"cannot be resolved by the sensors alone: {rank} independent measurements for {needed} "
                "unknowns of point and force, the priors determine the rest"
            )
        for contact in contacts:
            if contact.covariance.trace() <= UNRESOLVED_DEVIATION**2:
                # No less than the largest eigenvalue.
                continue
            deviation = float(np.sqrt(max(np.linalg.eigvalsh(contact.covariance)[-1], 0.0)))
            if deviation > UNRESOLVED_DEVIATION:
                parts.append(f"the point on {contact.link} is uncertain by {1e3 * deviation:.0f} mm")
        return parts


@kernel
def state_marginal_probabilities(rows: np.ndarray, set_of: np.ndarray, probability: np.ndarray) -> None:
    """Write into each row the sum of the probabilities of all sets that contain its contact.

    Args:
        rows: Contacts of all sets, those of a set one after another, as in
            `contactsense.runtime.result_rows`, shape (N, WIDTH).
        set_of: Number of the set of each row, shape (N,).
        probability: Of each set.
    """
    for i in range(rows.shape[0]):
        point, marginal, counted = rows[i, POINT_BASE], 0.0, -1
        for k in range(rows.shape[0]):
            if set_of[k] == counted or rows[k, LINK] != rows[i, LINK]:
                continue
            other = rows[k, POINT_BASE]
            x, y, z = other[0] - point[0], other[1] - point[1], other[2] - point[2]
            if x * x + y * y + z * z < SAME_POINT_DISTANCE * SAME_POINT_DISTANCE:
                counted = set_of[k]
                marginal += probability[counted]
        rows[i, PROBABILITY] = marginal
