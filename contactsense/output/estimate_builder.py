"""Build an `Estimate` from rows of numbers."""

import math
from collections.abc import Callable, Iterable
from operator import itemgetter
from typing import Any

import numpy as np

from contactsense.output.fast_dataclass import mutable_twin
from contactsense.output.touched_body import TouchedBody
from contactsense.runtime.result_rows import NUMBERS, VECTORS
from contactsense.runtime.state import State
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Status

_MutableEstimate, _MutableContact = mutable_twin(Estimate), mutable_twin(Contact)
_split = itemgetter(0, 1, 2, 3, slice(4, 7))
"""Point, point in the base frame, normal, force and covariance, of the vectors of one contact."""
NOT_EXPLAINED = "an external force acts on the arm, but no single push on a touchable link explains it well"


class EstimateBuilder:
    """Builds estimates for one scene."""

    def __init__(self, scene: Scene, constants: Constants, state: State) -> None:
        """Look up names and frames.

        Args:
            scene: The scene.
            constants: Its constants.
            state: Answer and poses of the sample that is being explained.
        """
        # For each sample: one look-up instead of four.
        answer = state.answer
        self._rows, self._numbers, self._vectors = answer.rows, answer.numbers.tolist, answer.vectors.copy
        self._wrench, self._covariance = answer.wrench.copy, answer.covariance.copy
        self._link_probability = state.link_probability.copy
        self._names = scene.link_names
        self._first_primitive: list[int] = constants.surfaces.start.tolist()
        self._touched_body = TouchedBody(scene, constants, state.motion) if scene.bodies else None
        self._clear = scene.clear
        self._flange = (scene.robot.flange_rotation, scene.robot.flange_translation)
        self._joints = len(scene.robot.joints)
        self._zeros = (np.zeros(len(self._names)), np.zeros(6), np.zeros((6, 6)))
        for array in self._zeros:
            array.setflags(write=False)
        self.no_contact = _without_contact(*self._zeros)
        """Creates an estimate without contact from time and detectable force, see `Estimate`. These estimates
        share their arrays, which are read-only."""
        self.detectable = math.inf
        """`Estimate.detectable` of the estimates that follow [N]."""

    def without_contacts(
        self, t: float, status: Status, reason: str = "", events: tuple[Event, ...] = ()
    ) -> Estimate:
        """Estimate without contacts: none present, or none can be estimated."""
        return Estimate(t, status, (), *self._zeros, reason=reason, events=events, detectable=self.detectable)

    def contacts(
        self,
        t: float,
        found: list[int],
        reason: str = "",
        number: int = 0,
        phase: Phase = "",
        kinds: tuple[EventKind, ...] = (),
    ) -> Estimate:
        """Estimate from `State.answer`, whose `integers` are `found`.

        With a `reason` the estimate is `degraded`. `number`, `phase` and the `kinds` of its events are those
        of the stream's contact.
        """
        count, link, primitive, _, _, _ = found
        contacts: tuple[Contact, ...] = ()
        best, other, name = 0.0, 1.0, ""
        if count:
            best, torsion, other = self._numbers()
            vectors = self._vectors()
            contacts = (self._contact(link, primitive, best, torsion, vectors, number, phase),)
            name = contacts[0].link
            if count > 1:
                contacts += self.contacts_of(self._rows[1:count].copy(), [(number, phase)] * (count - 1))
        status: Status = "contact" if best >= self._clear else "ambiguous"
        if reason:
            status = "degraded"
        if other > best:
            reason = f"{reason}; {NOT_EXPLAINED}" if reason else NOT_EXPLAINED
        estimate: Any = _MutableEstimate()
        estimate.t, estimate.status, estimate.contacts = t, status, contacts
        estimate.link_probability = self._link_probability()
        estimate.wrench, estimate.covariance = self._wrench(), self._covariance()
        estimate.other, estimate.reason = other if other > 0.0 else 0.0, reason
        estimate.events = tuple([Event(kind, number, t, name) for kind in kinds]) if kinds else ()
        estimate.explanations, estimate.detectable = (), self.detectable
        estimate.__class__ = Estimate
        filled: Estimate = estimate
        return filled

    def contacts_of(self, rows: np.ndarray, labels: Iterable[tuple[int, Phase]]) -> tuple[Contact, ...]:
        """Contacts from rows, see `contactsense.runtime.result_rows`, shape (N, WIDTH); they keep views of
        these. `labels`: number and phase of each."""
        vectors, first, found = rows[:, VECTORS].reshape(len(rows), 7, 3), self._first_primitive, []
        numbers: list[list[float]] = rows[:, NUMBERS].tolist()
        for i, ((link, primitive, probability, torsion), label) in enumerate(
            zip(numbers, labels, strict=True)
        ):
            index = int(link)
            found.append(
                self._contact(index, int(primitive) - first[index], probability, torsion, vectors[i], *label)
            )
        return tuple(found)

    def _contact(
        self,
        link: int,
        primitive: int,
        probability: float,
        torsion: float,
        vectors: np.ndarray,
        number: int,
        phase: Phase,
    ) -> Contact:
        """One contact, which keeps views of `vectors`; `primitive` is that among the link's own."""
        contact: Any = _MutableContact()
        contact.link, contact.link_index, contact.primitive = self._names[link], link, primitive
        contact.probability, contact.torsion = probability, torsion
        contact.point, point, contact.normal_base, force, covariance = _split(vectors)
        contact.point_base, contact.force_base, contact.covariance = point, force, covariance
        contact.id, contact.phase, contact.body = number, phase, ""
        if self._touched_body is not None:
            contact.body = self._touched_body.name(link, primitive, point, force, covariance)
        if link > self._joints:
            # A tool's points are given in the flange frame, not in that of its body.
            contact.point = (contact.point - self._flange[1]) @ self._flange[0]
        contact.__class__ = Contact
        filled: Contact = contact
        return filled


def _without_contact(
    link_probability: np.ndarray, wrench: np.ndarray, covariance: np.ndarray
) -> Callable[[float, float], Estimate]:
    """A function that creates estimates which differ in time and detectable force only."""

    def create(t: float, detectable: float) -> Estimate:
        estimate: Any = _MutableEstimate()
        estimate.t, estimate.status, estimate.contacts = t, "none", ()
        estimate.link_probability, estimate.wrench = link_probability, wrench
        estimate.covariance, estimate.other, estimate.reason = covariance, 0.0, ""
        estimate.events, estimate.explanations, estimate.detectable = (), (), detectable
        estimate.__class__ = Estimate
        found: Estimate = estimate
        return found

    return create
