"""Builds the `Estimate` of several simultaneous contacts from result rows."""

import dataclasses
import math
from collections.abc import Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from contactsense.multi_contact.explanations.marginal_probabilities import state_marginal_probabilities
from contactsense.multi_contact.explanations.set_reduction import merge_with_answer
from contactsense.multi_contact.memory.buffers import MAX_CONTACTS
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.output.fast_dataclass import mutable_twin
from contactsense.runtime.result_rows import WIDTH
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, Explanation, Phase, Status

UNRESOLVED_DEVIATION = 0.0225
"""A point with a larger standard deviation is reported as unresolved [m]."""
NOT_EXPLAINED = "the measurement differs from what these contacts cause by more than noise"
POINT_UNKNOWNS, FORCE_UNKNOWNS = 2, 3
"""Unknowns of a contact that the priors do not determine: point (2) and force (3)."""
UNTRACKED: Sequence[tuple[int, Phase]] = [(0, "")] * MAX_CONTACTS
"""Number and phase of contacts without a stream."""

_MutableExplanation = mutable_twin(Explanation)


class ContactSets(NamedTuple):
    """S sets of contacts that explain one measurement, the answer first."""

    rows: np.ndarray
    """All contacts, those of a set one after another, as in `contactsense.runtime.result_rows`, shape (N,
    WIDTH); the probability in each row is that of the whole set."""
    counts: np.ndarray
    """Number of contacts of each set, shape (S,), int64."""
    wrench: np.ndarray
    """Sum of the wrenches of the first set about the base origin, shape (6,) [N, Nm]."""
    covariance: np.ndarray
    """Its covariance, shape (6, 6)."""
    rank: int
    """Number of independent measurements of the first set's wrenches."""


class ContactSetBuilder:
    """Builds estimates of several simultaneous contacts for one scene."""

    def __init__(self, scene: Scene, estimate_builder: EstimateBuilder) -> None:
        """`estimate_builder` builds the single contacts."""
        self._estimate_builder = estimate_builder
        self._names = scene.link_names
        self._clear, self._has_base = scene.clear, scene.base_wrench is not None
        # Compiled before the first sample that several contacts explain.
        no_sets = np.zeros((0, WIDTH)), np.zeros(0, dtype=np.int64), np.zeros(0)
        merge_with_answer(*no_sets[:2])
        state_marginal_probabilities(*no_sets, np.zeros(len(self._names)))

    def sets(
        self,
        t: float,
        found: ContactSets,
        known_count: int,
        reason: str = "",
        tracked: Sequence[tuple[int, Phase]] = (),
        events: tuple[Event, ...] = (),
        is_explained: bool = True,
    ) -> Estimate:
        """Estimate from sets of contacts.

        Args:
            t: Time of the sample [s].
            found: The sets. The contacts keep views of a copy of the rows, with their own probabilities.
            known_count: Number of contacts whose points were known before.
            reason: Why the estimate is `degraded`, empty if it is not.
            tracked: Number and phase of each contact of a stream, the same in all sets.
            events: Onsets, holds and releases to report.
            is_explained: Whether noise can be what the first set leaves of the measurement.
        """
        rows, counts, wrench, covariance, rank = found
        if len(counts) == 0:
            why = "something acts on the arm, but no pushes on touchable links explain it"
            none = self._estimate_builder.without_contacts(
                t, "degraded" if reason else "ambiguous", f"{reason}; {why}".strip("; ")
            )
            return dataclasses.replace(none, other=1.0)
        if self._has_base and known_count > 0:
            stated, counts = merge_with_answer(rows, counts)
        else:
            stated = rows.copy()
        probability = np.empty(len(counts))
        link_probability = np.zeros(len(self._names))
        state_marginal_probabilities(stated, counts, probability, link_probability)
        probabilities: list[float] = probability.tolist()
        sets = self._explanations(stated, counts.tolist(), probabilities, tracked or UNTRACKED)
        contacts, highest = sets[0].contacts, probabilities[0]
        status: Status = "multiple"
        parts = [reason] if reason else []
        if not is_explained:
            parts.append(NOT_EXPLAINED)
        if len(contacts) == 1:
            status = "contact" if highest >= self._clear and is_explained else "ambiguous"
        else:
            parts += self._unresolved(contacts, rank, known_count)
            if highest < self._clear:
                parts.append(f"other explanations are not clearly worse ({highest:.0%} for this one)")
        return Estimate(
            t,
            "degraded" if reason else status,
            contacts,
            link_probability,
            wrench.copy(),
            covariance.copy(),
            max(1.0 - sum(probabilities), 0.0),
            "; ".join(parts),
            events,
            sets,
            self._estimate_builder.detectable,
        )

    def _explanations(
        self,
        rows: np.ndarray,
        counts: list[int],
        probabilities: list[float],
        labels: Sequence[tuple[int, Phase]],
    ) -> tuple[Explanation, ...]:
        """The sets of contacts; arguments as above, `labels` as `tracked`."""
        of_each = [label for count in counts for label in labels[:count]]
        contacts, sets = iter(self._estimate_builder.contacts_of(rows, of_each)), []
        for count, probability in zip(counts, probabilities, strict=True):
            explanation: Any = _MutableExplanation()
            explanation.contacts = tuple(islice(contacts, count))
            explanation.probability = probability
            explanation.__class__ = Explanation
            sets.append(explanation)
        return tuple(sets)

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
            deviation = _largest_deviation(contact.covariance)
            if deviation > UNRESOLVED_DEVIATION:
                parts.append(f"the point on {contact.link} is uncertain by {1e3 * deviation:.0f} mm")
        return parts


def _largest_deviation(covariance: np.ndarray) -> float:
    """Standard deviation [m] along the direction in which it is largest, of a covariance, shape (3, 3) [m^2].

    The root of the largest eigenvalue, in closed form (Smith 1961, Eigenvalues of a symmetric 3x3 matrix);
    for numbers of Python, since NumPy's own takes longer than an explanation's contacts.
    """
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = covariance.tolist()
    mean = (xx + yy + zz) / 3.0
    x, y, z = xx - mean, yy - mean, zz - mean
    size = math.sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if size == 0.0:
        return math.sqrt(max(mean, 0.0))
    x, y, z, xy, xz, yz = x / size, y / size, z / size, xy / size, xz / size, yz / size
    det = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)
    cosine = min(max(0.5 * det, -1.0), 1.0)
    return math.sqrt(max(mean + 2.0 * size * math.cos(math.acos(cosine) / 3.0), 0.0))
