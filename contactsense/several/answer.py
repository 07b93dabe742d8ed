"""From sets of contacts as rows of numbers to an `Estimate`."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contactsense.answer import Composer
from contactsense.report import PROBABILITY
from contactsense.scene import Scene
from contactsense.several.memory import MOST
from contactsense.types import Contact, Estimate, Event, Explanation, Phase, Status

SAME = 0.02
"""Contacts of two explanations on one link that are nearer than this count as the same [m]."""
OPEN = 0.0225
"""A place whose standard deviation is larger than this is said to be unresolved [m]."""
PLACE, FORCE = 2, 3
"""Unknowns of a contact that no prior settles: where it is on the surface, and its force."""


class SetComposer:
    """Makes estimates of several simultaneous contacts for one scene."""

    def __init__(self, scene: Scene, composer: Composer) -> None:
        """`composer` makes the single contacts."""
        self._composer = composer
        self._names = scene.link_names
        self._clear = scene.clear

    def sets(
        self,
        t: float,
        groups: Sequence[np.ndarray],
        wrench: np.ndarray,
        covariance: np.ndarray,
        rank: int,
        known: int,
        reason: str = "",
        tracked: Sequence[tuple[int, Phase]] = (),
        events: tuple[Event, ...] = (),
    ) -> Estimate:
        """Sets of contacts, the most probable first, as an estimate.

        Args:
            t: Time of the sample [s].
            groups: One array for each set: a row for each contact, as in `contactsense.report`, each with the
                probability of the whole set.
            wrench, covariance: Sum of the first set's wrenches, shape (6,), and its covariance, (6, 6).
            rank: How many independent numbers the sensors say about the first set's wrenches.
            known: Number of contacts whose places were known before.
            reason: Why the estimate is `degraded`, if it is.
            tracked: Number and phase of each contact of a stream, the same in all sets.
            events: What has happened to them.
        """
        if not groups:
            why = "something acts on the arm, but no pushes on touchable links explain it"
            return self._composer.quiet(
                t, "degraded" if reason else "ambiguous", f"{reason}; {why}".strip("; ")
            )
        named = tracked or [(0, "")] * MOST
        explanations = [
            Explanation(
                tuple(self._composer.contact(row, *label) for row, label in zip(rows, named, strict=False)),
                float(rows[0, PROBABILITY]),
            )
            for rows in groups
        ]
        sets = tuple(
            replace(e, contacts=tuple(replace(c, probability=_share(c, explanations)) for c in e.contacts))
            for e in explanations
        )
        best = sets[0]
        status: Status = "multiple"
        if len(best.contacts) == 1:
            status = "contact" if best.probability >= self._clear else "ambiguous"
        touched = [
            sum(e.probability for e in sets if any(c.link_index == link for c in e.contacts))
            for link in range(len(self._names))
        ]
        parts = [reason] if reason else []
        if len(best.contacts) > 1:
            parts += self._open(best.contacts, rank, known)
            if best.probability < self._clear:
                parts.append(
                    f"other explanations are not clearly worse ({best.probability:.0%} for this one)"
                )
        return Estimate(
            t,
            "degraded" if reason else status,
            best.contacts,
            np.array(touched),
            wrench.copy(),
            covariance.copy(),
            max(1.0 - sum(e.probability for e in sets), 0.0),
            "; ".join(parts),
            events,
            sets,
        )

    @staticmethod
    def _open(contacts: Sequence[Contact], rank: int, known: int) -> list[str]:
        """What the sensors cannot tell about these contacts."""
        parts = []
        links = [contact.link for contact in contacts]
        shared = [name for name in dict.fromkeys(links) if links.count(name) > 1]
        parts += [f"of the contacts on {name} the sensors see the sum only" for name in shared]
        needed = FORCE * len(contacts) + PLACE * (len(contacts) - known)
        if rank < needed:
            parts.append(
                f"cannot be resolved by the sensors alone: {rank} independent numbers for {needed} "
                "unknowns of place and force, the rest is what is usual for contacts"
            )
        for contact in contacts:
            spread = float(np.sqrt(max(np.linalg.eigvalsh(contact.covariance)[-1], 0.0)))
            if spread > OPEN:
                parts.append(f"the place on {contact.link} is open by {1e3 * spread:.0f} mm")
        return parts


def _share(contact: Contact, explanations: Sequence[Explanation]) -> float:
    """Probability of all explanations that have this contact."""
    return sum(
        explanation.probability
        for explanation in explanations
        if any(
            other.link_index == contact.link_index
            and float(np.linalg.norm(other.point_base - contact.point_base)) < SAME
            for other in explanation.contacts
        )
    )
