"""What the rules decide: a level begins or ends."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

LevelName = Literal["contact", "collision"]


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
    """Number of the contact in its stream; 0 where no single push explains the measurement."""
    link: str = ""
    """The most probable link among the rule's; empty where there is none."""
    link_index: int = -1
    """Its number, the base being 0; -1 where there is none."""
    point: tuple[float, ...] = ()
    """Contact centroid, link frame [m]."""
    point_base: tuple[float, ...] = ()
    """Contact centroid, base frame [m]."""
    force_base: tuple[float, ...] = ()
    """Force on the robot, base axes [N]."""
    force: float = 0.0
    """Its magnitude [N]."""

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)
