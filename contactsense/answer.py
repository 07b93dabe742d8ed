"""From rows of numbers to an `Estimate`."""

import numpy as np

from contactsense.memory import Memory
from contactsense.report import (
    COVARIANCE,
    FORCE,
    LINK,
    NORMAL,
    POINT,
    POINT_BASE,
    PRIMITIVE,
    PROBABILITY,
    TORSION,
)
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Event, EventKind, Phase, Status

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
        return Estimate(t, "none", (), *self._zeros)

    def quiet(self, t: float, status: Status, reason: str = "", events: tuple[Event, ...] = ()) -> Estimate:
        """No contact, or no answer."""
        return Estimate(t, status, (), *self._zeros, reason=reason, events=events)

    def contacts(
        self,
        t: float,
        memory: Memory,
        rows: np.ndarray,
        reason: str = "",
        number: int = 0,
        phase: Phase = "",
        kinds: tuple[EventKind, ...] = (),
    ) -> Estimate:
        """The explanations in `rows`, as `contactsense.report` writes them; with a `reason` the estimate is
        `degraded`. `number`, `phase` and `kinds` of events are those of the stream's contact."""
        rows = rows.copy()
        listed = tuple([self.contact(row, number, phase) for row in rows])
        other = max(1.0 - sum([contact.probability for contact in listed]), 0.0)
        best = listed[0].probability if listed else 0.0
        status: Status = "contact" if best >= self._clear else "ambiguous"
        link = listed[0].link_index if listed else int(np.argmin(memory.hypotheses.energy))
        name = listed[0].link if listed else ""
        doubt = UNEXPLAINED if other > best else ""
        return Estimate(
            t,
            "degraded" if reason else status,
            listed,
            memory.link_probability.copy(),
            memory.hypotheses.wrench[link].copy(),
            memory.hypotheses.covariance[link].copy(),
            other,
            "; ".join(part for part in (reason, doubt) if part),
            tuple([Event(kind, number, t, name) for kind in kinds]),
        )

    def contact(self, row: np.ndarray, number: int = 0, phase: Phase = "") -> Contact:
        """One contact from a row, see `contactsense.report`; keeps views of it."""
        link, primitive = int(row[LINK]), int(row[PRIMITIVE])
        point = row[POINT]
        if link > self._joints:
            # A tool's own frame is the flange's, not that of the body that carries it.
            point = (point - self._flange[1]) @ self._flange[0]
        return Contact(
            self._names[link],
            link,
            primitive - self._first[link],
            float(row[PROBABILITY]),
            point,
            row[POINT_BASE],
            row[NORMAL],
            row[FORCE],
            float(row[TORSION]),
            row[COVARIANCE].reshape(3, 3),
            number,
            phase,
        )
