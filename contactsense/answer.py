"""From rows of numbers to an `Estimate`."""

import numpy as np

from contactsense.memory import Memory
from contactsense.quick import unlocked
from contactsense.report import NUMBERS, VECTORS
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Status

_open_estimate, _open_contact = unlocked(Estimate), unlocked(Contact)
UNEXPLAINED = "something acts on the arm, but no single push on a touchable link explains it well"


class Composer:
    """Makes estimates for one scene."""

    def __init__(self, scene: Scene, first_primitive: np.ndarray) -> None:
        """Names and frames of `scene` are looked up once; `first_primitive`: number of each link's first."""
        self._names = scene.link_names
        self._first: list[int] = first_primitive.tolist()
        self._clear = scene.clear
        self._flange = (scene.robot.flange_rotation, scene.robot.flange_translation)
        self._joints = len(scene.robot.joints)
        self._zeros = (np.zeros(len(self._names)), np.zeros(6), np.zeros((6, 6)))
        for array in self._zeros:
            array.setflags(write=False)

    def nothing(self, t: float) -> Estimate:
        """Nothing touches; such estimates share their arrays, which cannot be written."""
        estimate = _open_estimate(t, "none", (), *self._zeros)
        estimate.__class__ = Estimate
        return estimate

    def quiet(self, t: float, status: Status, reason: str = "", events: tuple[Event, ...] = ()) -> Estimate:
        """No contact, or no answer."""
        return Estimate(t, status, (), *self._zeros, reason=reason, events=events)

    def contacts(
        self,
        t: float,
        memory: Memory,
        rows: np.ndarray,
        count: int,
        reason: str = "",
        number: int = 0,
        phase: Phase = "",
        kinds: tuple[EventKind, ...] = (),
    ) -> Estimate:
        """The explanations in the first `count` of `rows`, as `contactsense.report` writes them; with a
        `reason` the estimate is `degraded`. `number`, `phase` and `kinds` of events are those of the stream's
        contact."""
        listed = tuple([self.contact(rows[k].copy(), number, phase) for k in range(count)])
        other = 1.0
        for contact in listed:
            other -= contact.probability
        if listed:
            best, link, name = listed[0].probability, listed[0].link_index, listed[0].link
        else:
            best, link, name = 0.0, int(np.argmin(memory.hypotheses.energy)), ""
        status: Status = "contact" if best >= self._clear else "ambiguous"
        if reason:
            status = "degraded"
        if other > best:
            reason = f"{reason}; {UNEXPLAINED}" if reason else UNEXPLAINED
        estimate = _open_estimate(
            t,
            status,
            listed,
            memory.link_probability.copy(),
            memory.hypotheses.wrench[link].copy(),
            memory.hypotheses.covariance[link].copy(),
            max(other, 0.0),
            reason,
            tuple([Event(kind, number, t, name) for kind in kinds]) if kinds else (),
        )
        estimate.__class__ = Estimate
        return estimate

    def contact(self, row: np.ndarray, number: int = 0, phase: Phase = "") -> Contact:
        """One contact from a row, see `contactsense.report`; keeps views of it."""
        link, primitive, probability, torsion = row[NUMBERS].tolist()
        link = int(link)
        vectors = row[VECTORS].reshape(7, 3)
        point = vectors[0]
        if link > self._joints:
            # A tool's own frame is the flange's, not that of the body that carries it.
            point = (point - self._flange[1]) @ self._flange[0]
        contact = _open_contact(
            self._names[link],
            link,
            int(primitive) - self._first[link],
            probability,
            point,
            vectors[1],
            vectors[2],
            vectors[3],
            torsion,
            vectors[4:],
            number,
            phase,
        )
        contact.__class__ = Contact
        return contact
