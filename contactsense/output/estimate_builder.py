"""Build an `Estimate` from rows of numbers."""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.output.fast_dataclass import mutable_twin
from contactsense.output.touched_body import TouchedBody
from contactsense.runtime.constants import Constants
from contactsense.runtime.result_rows import NUMBERS, VECTORS
from contactsense.runtime.state import State
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Status

_new_estimate, _new_contact = mutable_twin(Estimate), mutable_twin(Contact)
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
        self.detectable = math.inf
        """`Estimate.detectable` of the estimates that follow [N]."""

    def no_contact(self, t: float, detectable: float) -> Estimate:
        """Estimate without contact. These estimates share their arrays, which are read-only."""
        estimate = _new_estimate(t, "none", (), *self._zeros, detectable=detectable)
        estimate.__class__ = Estimate
        return estimate

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
        `contactsense.runtime.result_rows`.

        With a `reason` the estimate is `degraded`. `number`, `phase` and the `kinds` of its events are those
        of the stream's contact.
        """
        candidates = tuple([self.contact(rows[k].copy(), number, phase) for k in range(count)])
        other = 1.0
        for contact in candidates:
            other -= contact.probability
        if candidates:
            best, link, name = candidates[0].probability, candidates[0].link_index, candidates[0].link
        else:
            best, link, name = 0.0, int(np.argmin(state.hypotheses.energy)), ""
        status: Status = "contact" if best >= self._clear else "ambiguous"
        if reason:
            status = "degraded"
        if other > best:
            reason = f"{reason}; {NOT_EXPLAINED}" if reason else NOT_EXPLAINED
        estimate = _new_estimate(
            t,
            status,
            candidates,
            state.link_probability.copy(),
            state.hypotheses.wrench[link].copy(),
            state.hypotheses.covariance[link].copy(),
            max(other, 0.0),
            reason,
            tuple([Event(kind, number, t, name) for kind in kinds]) if kinds else (),
            detectable=self.detectable,
        )
        estimate.__class__ = Estimate
        return estimate

    def contact(self, row: np.ndarray, number: int = 0, phase: Phase = "") -> Contact:
        """One contact from a row, see `contactsense.runtime.result_rows`; it keeps views of the row."""
        link, primitive, probability, torsion = row[NUMBERS].tolist()
        link = int(link)
        primitive = int(primitive) - self._first_primitive[link]
        vectors = row[VECTORS].reshape(7, 3)
        point, body = vectors[0], ""
        if self._touched_body is not None:
            body = self._touched_body.name(link, primitive, vectors[1], vectors[3], vectors[4:])
        if link > self._joints:
            # A tool's points are given in the flange frame, not in that of its body.
            point = (point - self._flange[1]) @ self._flange[0]
        contact = _new_contact(
            self._names[link],
            link,
            primitive,
            probability,
            point,
            vectors[1],
            vectors[2],
            vectors[3],
            torsion,
            vectors[4:],
            number,
            phase,
            body,
        )
        contact.__class__ = Contact
        return contact
