"""Build an `Estimate` from rows of numbers."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.output.fast_dataclass import mutable_twin
from contactsense.output.touched_body import TouchedBody
from contactsense.runtime.constants import Constants
from contactsense.runtime.result_rows import NUMBERS, VECTORS
from contactsense.runtime.state import State
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Status

_MutableEstimate, _MutableContact = mutable_twin(Estimate), mutable_twin(Contact)
_new = object.__new__
NOT_EXPLAINED = "an external force acts on the arm, but no single push on a touchable link explains it well"


class EstimateBuilder:
    """Builds estimates for one scene."""

    def __init__(self, scene: Scene, constants: Constants, motion: Motion) -> None:
        """Look up names and frames.

        Args:
            scene: The scene.
            constants: Its constants.
            motion: Poses of the links in the sample that is being explained.
        """
        self._names = scene.link_names
        self._first_primitive: list[int] = constants.surfaces.start.tolist()
        self._touched_body = TouchedBody(scene, constants, motion) if scene.bodies else None
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
        state: State,
        rows: np.ndarray,
        count: int,
        reason: str = "",
        number: int = 0,
        phase: Phase = "",
        kinds: tuple[EventKind, ...] = (),
    ) -> Estimate:
        """Estimate from the candidates in the first `count` of `rows`, see
        `contactsense.runtime.result_rows`, and from `State.answer`.

        With a `reason` the estimate is `degraded`. `number`, `phase` and the `kinds` of its events are those
        of the stream's contact.
        """
        link_probability, wrench = state.link_probability.copy(), state.answer.wrench.copy()
        if count == 0:
            return self._filled(t, (), link_probability, wrench, 1.0, reason, number, kinds)
        best = self._contact(state.answer.numbers.tolist(), state.answer.vectors.copy(), number, phase)
        candidates: tuple[Contact, ...] = (best,)
        other = 1.0 - best.probability
        if count > 1:
            others = [self.contact(rows[k].copy(), number, phase) for k in range(1, count)]
            candidates = (best, *others)
            for contact in others:
                other -= contact.probability
        return self._filled(t, candidates, link_probability, wrench, other, reason, number, kinds)

    def _filled(
        self,
        t: float,
        candidates: tuple[Contact, ...],
        link_probability: np.ndarray,
        wrench: np.ndarray,
        other: float,
        reason: str,
        number: int,
        kinds: tuple[EventKind, ...],
    ) -> Estimate:
        """The estimate; arguments as for `contacts`, `other` as in `Estimate`, `wrench` as `State.answer`."""
        best, name = (candidates[0].probability, candidates[0].link) if candidates else (0.0, "")
        status: Status = "contact" if best >= self._clear else "ambiguous"
        if reason:
            status = "degraded"
        if other > best:
            reason = f"{reason}; {NOT_EXPLAINED}" if reason else NOT_EXPLAINED
        estimate: Any = _new(_MutableEstimate)
        estimate.t, estimate.status, estimate.contacts = t, status, candidates
        estimate.link_probability = link_probability
        estimate.wrench, estimate.covariance = wrench[0], wrench[1:]
        estimate.other, estimate.reason = other if other > 0.0 else 0.0, reason
        estimate.events = tuple([Event(kind, number, t, name) for kind in kinds]) if kinds else ()
        estimate.explanations, estimate.detectable = (), self.detectable
        estimate.__class__ = Estimate
        filled: Estimate = estimate
        return filled

    def contact(self, row: np.ndarray, number: int = 0, phase: Phase = "") -> Contact:
        """One contact from a row, see `contactsense.runtime.result_rows`; it keeps views of the row."""
        return self._contact(row[NUMBERS].tolist(), row[VECTORS].reshape(7, 3), number, phase)

    def _contact(self, numbers: list[float], vectors: np.ndarray, number: int, phase: Phase) -> Contact:
        link, primitive = int(numbers[0]), int(numbers[1])
        primitive -= self._first_primitive[link]
        point, point_base, force, covariance, body = vectors[0], vectors[1], vectors[3], vectors[4:], ""
        if self._touched_body is not None:
            body = self._touched_body.name(link, primitive, point_base, force, covariance)
        if link > self._joints:
            # A tool's points are given in the flange frame, not in that of its body.
            point = (point - self._flange[1]) @ self._flange[0]
        contact: Any = _new(_MutableContact)
        contact.link, contact.link_index, contact.primitive = self._names[link], link, primitive
        contact.probability, contact.torsion = numbers[2], numbers[3]
        contact.point, contact.point_base = point, point_base
        contact.normal_base, contact.force_base = vectors[2], force
        contact.covariance, contact.body = covariance, body
        contact.id, contact.phase = number, phase
        contact.__class__ = Contact
        filled: Contact = contact
        return filled


def _without_contact(
    link_probability: np.ndarray, wrench: np.ndarray, covariance: np.ndarray
) -> Callable[[float, float], Estimate]:
    """A function that creates estimates which differ in time and detectable force only."""

    def create(t: float, detectable: float) -> Estimate:
        estimate: Any = _new(_MutableEstimate)
        estimate.t, estimate.status, estimate.contacts = t, "none", ()
        estimate.link_probability, estimate.wrench = link_probability, wrench
        estimate.covariance, estimate.other, estimate.reason = covariance, 0.0, ""
        estimate.events, estimate.explanations, estimate.detectable = (), (), detectable
        estimate.__class__ = Estimate
        found: Estimate = estimate
        return found

    return create
