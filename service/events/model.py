"""One event of the journal, as it is stored and as it is sent over HTTP and WebSocket."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Kind = Literal[
    "onset", "hold", "slide", "release", "resume", "weight",
    "collision", "acknowledged", "action", "expected",
]  # fmt: skip
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]


class ContactEvent(BaseModel):
    """Something that happened to a contact, or a reaction to it.

    `onset`, `hold`, `slide`, `release` and `resume` summarize the contact from its onset to the time of the
    event.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: int = Field(0, description="Number in the journal. It rises; there may be gaps. 0: not in a journal.")
    kind: Kind = Field(
        description="onset: a contact began; hold: it keeps its place; slide: it moves; release: it ended, "
        "or what watched it did, see reason; resume: it has not ended after all, another release will "
        "follow; weight: it was no contact but a "
        "weight that was picked up or put down; collision: a rule's collision level was exceeded and "
        "latched; acknowledged: a latch was cleared; action: an action was carried out or failed, see "
        "reason; expected: a window for an expected contact was opened or closed."
    )
    contact: int = Field(0, description="Number of the contact in its stream; 0 where there is none.")
    t: float | None = Field(
        None, description="Time on the robot's clock [s]; null where no sample has arrived yet."
    )
    time: str = Field("", description="Time on the host's clock, ISO 8601 in UTC.")
    link: str = Field(
        "",
        description="The most probable link; of the whole contact where it has ended. Of kind "
        "action: that of the decision that started it.",
    )
    body: str = Field(
        "",
        description="The scene's body that most samples of the contact name; empty where there is none.",
    )
    point: Vector | None = Field(
        None, description="Contact centroid, link frame [m]: the weighted mean over the contact so far."
    )
    point_base: Vector | None = Field(None, description="The same in the base frame [m].")
    force_base: Vector | None = Field(None, description="Force on the robot, base axes [N], at this moment.")
    force: float = Field(0.0, description="Its magnitude [N].")
    peak_force: float = Field(
        0.0,
        description="Largest magnitude since the onset [N]. Moments without the base sensor do not count, "
        "unless it is missing throughout.",
    )
    impulse: float = Field(
        0.0,
        description="Magnitude of the force's integral over time since the onset [N s], with the same "
        "exception.",
    )
    duration: float = Field(0.0, description="Time since the onset [s].")
    probability: float = Field(
        0.0,
        description="Probability of the link, averaged over the contact so far; of a collision: that the "
        "force exceeds the level.",
    )
    covariance: list[list[float | None]] | None = Field(
        None,
        description="Covariance of point_base [m^2], 3 x 3: that of a typical sample of the contact, as the "
        "errors of consecutive samples are correlated.",
    )
    torsion: float = Field(0.0, description="Moment on the robot about the outward normal [Nm].")
    mass: float = Field(0.0, description="Change of the carried mass [kg]; of kind weight.")
    rule: str = Field(
        "",
        description="Name of the rule, of kinds collision, acknowledged and action; empty "
        "where no rule started the action, as where its connection is lost.",
    )
    action: str = Field("", description="Name of the action, of kind action.")
    reason: str = Field("", description="What there is to say about it: one sentence for a person.")
