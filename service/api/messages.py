"""Messages over HTTP and WebSocket, with units and frames for the OpenAPI page.

Names and shapes are those of `contactsense.types`. The base frame is the robot controller's own; wrenches are
force then moment, moments about the base origin.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, FailFast, Field, Tag

from contactsense.service.api.request_body import RequestBody
from contactsense.service.events.model import ContactEvent
from contactsense.service.live.health import PipelineHealth, SourceHealth
from contactsense.service.reactions.health import ReactionsHealth
from contactsense.types import Phase, Status

Numbers = list[float]
Three = Annotated[Numbers, Field(min_length=3, max_length=3)]
Six = Annotated[Numbers, Field(min_length=6, max_length=6)]
Contacts = Annotated[int, Field(ge=1, le=3)]
OfJoints = Annotated[Numbers, Field(max_length=64)]
MAX_SAMPLES = 10_000
"""Largest number of samples in one request."""


class SampleIn(RequestBody):
    """Readings of the sensors at one instant, with the arm at rest."""

    q: OfJoints = Field(description="Joint positions [rad], one per joint.")
    base_wrench: Six | None = Field(
        None,
        description="Wrench of the arm on the sensor under its base, force then moment about the base "
        "origin, base axes [N, Nm]. With external=true only the contact's share: a force f on the robot at c "
        "leaves (f, c x f).",
    )
    joint_torque: OfJoints | None = Field(
        None,
        description="Torque that each actuator applies [Nm], one per joint. With external=true only the "
        "contact's share: a force f on the robot leaves -J^T f.",
    )
    wrist_wrench: Six | None = Field(
        None,
        description="Wrench of all beyond the wrist sensor on that sensor, force then moment about the base "
        "origin, base axes [N, Nm].",
    )
    link_wrenches: dict[str, Six] | None = Field(
        None,
        max_length=64,
        description="The same of each further sensor within the arm, by its name in the scene's "
        "link_wrenches.",
    )


class LocateOneIn(SampleIn):
    """One sample to locate."""

    external: bool = Field(
        True,
        description="true: gravity is already subtracted, the readings are caused by contacts only. "
        "false: raw readings; the scene's model is subtracted.",
    )
    contacts: Contacts = Field(
        1,
        description="Largest number of simultaneous contacts, at most that of the scene. With several the "
        "status is multiple if they explain the measurement better than one.",
    )


class LocateManyIn(RequestBody):
    """Several samples to locate, each by itself."""

    # Validation ends at the first sample that cannot be used: thousands of errors help nobody.
    samples: Annotated[list[SampleIn], FailFast()] = Field(
        min_length=1, max_length=MAX_SAMPLES, description="The samples."
    )
    external: bool = Field(True, description="As for one sample; applies to all of them.")
    contacts: Contacts = Field(1, description="Likewise.")


def _one_or_many(value: Any) -> str:
    many = "samples" in value if isinstance(value, dict) else isinstance(value, LocateManyIn)
    return "many" if many else "one"


LocateIn = Annotated[
    Annotated[LocateOneIn, Tag("one")] | Annotated[LocateManyIn, Tag("many")], Discriminator(_one_or_many)
]


class ContactOut(BaseModel):
    """One explanation of the measurement: a point on a link and the force at this point."""

    link: str = Field(description="Name of the touched link.")
    link_index: int = Field(description="Its number, the base being 0.")
    primitive: int = Field(description="Number of the touched primitive among that link's own.")
    probability: float = Field(description="Probability that this is the contact, given the measurement.")
    point: Three = Field(description="Contact centroid, link frame [m].")
    point_base: Three = Field(description="Contact centroid, base frame [m].")
    normal_base: Three = Field(description="Outward unit normal of the link there, base axes.")
    force_base: Three = Field(description="Force on the robot, base axes [N].")
    torsion: float = Field(description="Moment on the robot about the outward normal [Nm].")
    covariance: list[list[float | None]] = Field(
        description="Covariance of point_base, base axes [m^2], 3 x 3; null where it is not bounded."
    )
    id: int = Field(
        0,
        description="Number of the contact in its stream, from 1; explanations of the same contact share it. "
        "0 where there is no stream.",
    )
    phase: Phase = Field(
        "",
        description="new: it has just begun; hold: it keeps its place; slide: it moves; empty where there is "
        "no stream.",
    )
    body: str = Field(
        "",
        description="Name of the scene's body that the contact is with: the pedestal that is touched, or an "
        "obstacle that explains the contact; empty where there is none.",
    )


class EstimateOut(BaseModel):
    """The localizer's answer to one sample."""

    t: float = Field(description="Time of the sample on the robot's clock [s].")
    status: Status = Field(
        description="none: nothing touches; contact: one clear answer; ambiguous: others are not clearly "
        "worse; multiple: more than one contact at a time; degraded: a sensor is missing or unusable, see "
        "reason."
    )
    contacts: list[ContactOut] = Field(
        description="Explanations, most probable first. Where the status is multiple: the contacts that "
        "act at the same time."
    )
    link_probability: Numbers = Field(
        description="Probability that each link is the touched one, in the order of the scene's links; zeros "
        "where nothing touches."
    )
    other: float = Field(
        0.0,
        description="Probability that it is none of contacts: a pull, a couple, several contacts, or a place "
        "too improbable to be listed. With those of contacts it adds up to one where anything acts.",
    )
    wrench: list[float | None] = Field(
        description="External wrench on the arm under the best explanation, force then moment about the base "
        "origin, base axes [N, Nm]; null where it cannot be determined, zeros without contact."
    )
    covariance: list[list[float | None]] = Field(
        description="Covariance of wrench, 6 x 6; null where it is not bounded, zeros without contact, where "
        "nothing is estimated."
    )
    detectable: float | None = Field(
        None,
        description="Smallest force that the usable sensors detect with probability 0.9, wherever and in "
        "whichever direction it acts on the arm, while it is held [N]; null where no force is sure to be "
        "detected, as with joint torques alone. It is what the status none rules out.",
    )
    reason: str = Field(description="Why the status is what it is, where that is not plain.")
    q: list[float | None] | None = Field(
        None,
        description="Joint positions of the sample [rad]: they turn points of links into points of the base "
        "frame. Only in the pipeline's stream, and null where one is unknown.",
    )
    events: list[ContactEvent] = Field(
        [],
        description="What has happened to contacts since the message before; in a thinned stream also at the "
        "samples between.",
    )


class EstimatesOut(BaseModel):
    """The localizer's answers to several samples."""

    estimates: list[EstimateOut] = Field(description="One per sample, in their order.")


class LostOut(BaseModel):
    """Message in the stream to a reader that was too slow."""

    lost: int = Field(description="Estimates that this reader has lost since its last message.")


class LinkOut(BaseModel):
    """A rigid body of the arm."""

    name: str = Field(description="Its name in estimates.")
    mass: float = Field(description="Mass [kg].")
    com: Three = Field(description="Centre of mass, link frame [m].")
    primitives: list[dict[str, Any]] = Field(description="Convex pieces of its surface, link frame [m].")


class JointOut(BaseModel):
    """A revolute joint."""

    name: str = Field(description="Its name.")
    position_limits: tuple[float | None, float | None] = Field(
        description="Lowest and highest angle [rad]; null of an endless joint."
    )
    velocity_limit: float | None = Field(description="Largest speed [rad/s]; null if it is not known.")
    torque_limit: float | None = Field(description="Largest torque [Nm]; null if it is not known.")


class RobotOut(BaseModel):
    """The arm."""

    name: str = Field(description="Its name.")
    mass: float = Field(description="Mass of the whole arm, base included [kg].")
    links: list[LinkOut] = Field(description="Links, base first.")
    joints: list[JointOut] = Field(description="Joint j carries link j, counting joints from 1.")


class SceneOut(BaseModel):
    """The arm in its cell."""

    links: list[str] = Field(description="Names of all links, base first.")
    gravity_base: Three = Field(description="Gravity in base axes [m/s^2].")
    scene: dict[str, Any] = Field(description="The scene as its YAML file would have it.")


class StreamHealth(BaseModel):
    """State of the stream and its readers."""

    readers: int = Field(0, description="Open WebSocket streams.")
    lost: int = Field(0, description="Estimates lost by slow readers, all together.")


class ClientHealth(BaseModel):
    """State of the client connections, and counters of the limits."""

    connections: int = Field(0, description="Open connections, WebSockets included.")
    refused: int = Field(0, description="Connections refused because there were too many.")
    late: int = Field(
        0,
        description="Connections closed because a request's head was too slow or too large, or gave way to "
        "another connection.",
    )
    dropped: int = Field(
        0, description="Connections closed because nothing was taken from them for too long."
    )
    beyond_limits: dict[str, int] = Field({}, description="Requests refused, by HTTP status: 408, 413, 429.")


class ReloadHealth(BaseModel):
    """The latest reload of the scene (SIGHUP)."""

    time: str = Field(description="When, ISO 8601 in UTC.")
    ok: bool = Field(description="Whether the new files are in use; if not, nothing has changed.")
    message: str = Field(description="What was wrong with them; empty where nothing was.")


class ReadyOut(BaseModel):
    """Whether the service is ready."""

    ready: bool = Field(description="Whether estimates are current; without a robot: whether it runs.")
    status: str = Field(description="As in health.")
    reasons: list[str] = Field(description="As in health.")


class HealthOut(BaseModel):
    """State of the service."""

    status: Literal["ok", "degraded", "starting", "waiting", "failing", "idle"] = Field(
        description="Computed at each request. ok: samples arrive and are estimated; degraded: they are, "
        "but something is missing or wrong, see reasons; starting: kernels are being loaded; waiting: no "
        "usable samples, sensors are tried again all the time; failing: the pipeline itself broke or hangs "
        "and is being restarted; idle: no robot is configured, only POST /v1/locate and WS /v1/track work."
    )
    message: str = Field(description="The same for a person, with what to do about it.")
    reasons: list[str] = Field(description="The parts of message, one for each thing that is wrong.")
    ready: bool = Field(description="As GET /v1/ready: whether estimates are current.")
    loading: float = Field(
        ge=0.0,
        le=1.0,
        description="Share of the first compilation of the kernels that is done; 1 when it is over.",
    )
    loading_left: float | None = Field(
        None, description="Estimated time left of the compilation [s]; null while nothing is compiled."
    )
    since: str = Field(description="When this status began, ISO 8601 in UTC.")
    uptime: float = Field(description="Time since the service began [s].")
    version: str = Field(description="Version of the package.")
    source: SourceHealth
    pipeline: PipelineHealth
    stream: StreamHealth
    clients: ClientHealth
    lag: float = Field(description="By how much the web process was late when it last looked [s].")
    reload: ReloadHealth | None = Field(description="The latest reload; null where there was none.")
    reactions: ReactionsHealth = ReactionsHealth()


class FieldError(BaseModel):
    """What is wrong with one field."""

    field: str = Field(description="Path of the field, as samples[3].q.")
    reason: str = Field(description="What was expected and what was received.")


class ErrorOut(BaseModel):
    """Why a request was refused."""

    errors: list[FieldError] = Field(description="Each mistake, with its field.")
