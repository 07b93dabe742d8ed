"""Decisions of the rules: a level begins or ends."""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple, Self

from contactsense.types import Contact

LevelName = Literal["contact", "collision"]


class Origin(NamedTuple):
    """Why an action was started: what its events tell of the decision."""

    rule: str = ""
    """Empty: no rule did, as where it is prepared or its connection is lost."""
    link: str = ""


@dataclass(frozen=True, slots=True)
class Decision:
    """A level of a rule has begun, or has ended, with this sample."""

    rule: str
    """Name of the rule."""
    level: LevelName
    kind: Literal["begin", "end"]
    actions: tuple[str, ...]
    """Names of the actions of that level."""
    t: float
    """Time of the sample on the robot's clock [s]."""
    probability: float
    """Probability that the force exceeds the level."""
    contact: int = 0
    """Number of the contact in its stream; 0 if no single push explains the measurement."""
    link: str = ""
    """The most probable of the rule's links; empty if there is none."""
    link_index: int = -1
    """Number of the link (base: 0); -1 if there is none."""
    point: tuple[float, ...] = ()
    """Contact centroid, link frame [m]."""
    point_base: tuple[float, ...] = ()
    """Contact centroid, base frame [m]."""
    force_base: tuple[float, ...] = ()
    """Force on the robot, base axes [N]."""
    force: float = 0.0
    """Magnitude of the force [N]."""

    @property
    def origin(self) -> Origin:
        """What events of its actions tell of it."""
        return Origin(self.rule, self.link)

    def with_contact(self, contact: Contact) -> Self:
        """Return the decision with link, place and force of this explanation."""
        force = contact.force_base.tolist()
        return replace(
            self,
            contact=contact.id,
            link=contact.link,
            link_index=contact.link_index,
            point=tuple(contact.point.tolist()),
            point_base=tuple(contact.point_base.tolist()),
            force_base=tuple(force),
            force=math.hypot(*force),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the decision as a dictionary for JSON."""
        return asdict(self)
