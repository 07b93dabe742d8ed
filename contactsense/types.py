"""What travels through the localizer: one `Sample` in, one `Estimate` out."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Status = Literal["none", "contact", "ambiguous", "multiple", "degraded"]
Phase = Literal["", "new", "hold", "slide"]
"""What a contact of a stream does: it has just begun, keeps its place, or moves; empty without a stream."""
EventKind = Literal["onset", "hold", "slide", "release", "weight"]


@dataclass(frozen=True, slots=True)
class Sample:
    """What the sensors say at one instant. A sensor that is absent, or silent at this instant, is None."""

    t: float
    """Time of the measurement on the robot's clock [s]."""
    q: np.ndarray
    """Joint positions [rad], shape (n,)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (n,)."""
    joint_torque: np.ndarray | None = None
    """Torque that each actuator applies [Nm], shape (n,)."""
    base_wrench: np.ndarray | None = None
    """Wrench of the arm on the sensor below it, force then moment about the base origin, base axes [N, Nm],
    shape (6,)."""
    wrist_wrench: np.ndarray | None = None
    """Wrench of all beyond the wrist sensor on it, force then moment about the base origin, base axes [N,
    Nm], shape (6,)."""


@dataclass(frozen=True, slots=True)
class Contact:
    """One explanation of the measurement: a place on a link and the force that enters there."""

    link: str
    """Name of the touched link."""
    link_index: int
    """Its number, the base being 0."""
    primitive: int
    """Number of the touched primitive among that link's own."""
    probability: float
    """Probability that this is the contact, given the measurement."""
    point: np.ndarray
    """Contact centroid, link frame [m], shape (3,)."""
    point_base: np.ndarray
    """Contact centroid, base frame [m], shape (3,)."""
    normal_base: np.ndarray
    """Outward unit normal of the link there, base axes, shape (3,)."""
    force_base: np.ndarray
    """Force on the robot, base axes [N], shape (3,)."""
    torsion: float
    """Moment on the robot about the outward normal [Nm]."""
    covariance: np.ndarray
    """Covariance of `point_base`, base axes [m^2], shape (3, 3)."""
    id: int = 0
    """Number of the contact in its stream, from 1; explanations of the same contact share it. 0 without a
    stream."""
    phase: Phase = ""
    """What it does."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened to a contact with this sample."""

    kind: EventKind
    """`onset`: it began; `hold`: it keeps its place; `slide`: it moves; `release`: it ended; `weight`: it was
    none, but a weight that was picked up or put down."""
    contact: int
    """Its number, see `Contact.id`."""
    t: float
    """Time of the sample [s]."""
    link: str = ""
    """The most probable link, where there is one."""
    mass: float = 0.0
    """By how much the weight that the arm carries has changed [kg]."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """Contacts that act at the same time and together explain one measurement."""

    contacts: tuple[Contact, ...]
    """Each with its own probability: that of all explanations which have it."""
    probability: float
    """Probability of just these contacts, given the measurement."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What the localizer makes of one sample."""

    t: float
    """Time of the sample [s]."""
    status: Status
    """`none`: nothing touches; `contact`: one clear answer; `ambiguous`: others are not clearly worse;
    `multiple`: several contacts at a time; `degraded`: a sensor is missing or unusable, see `reason`."""
    contacts: tuple[Contact, ...]
    """Explanations, most probable first; with `other` their probabilities add up to one.
    Where the status is `multiple`: the contacts that act at the same time, of the best of `explanations`."""
    link_probability: np.ndarray
    """Probability that each link is the touched one, shape (n + 1,); zeros where nothing touches. What they
    lack to one is the probability that it is no single push on a touchable link: a pull, a couple, several
    contacts. Where the status is
    `multiple`: probability that each link is touched, which may add up to more than one."""
    wrench: np.ndarray
    """External wrench on the arm under the best explanation, force then moment about the base origin, base
    axes [N, Nm], shape (6,)."""
    covariance: np.ndarray
    """Covariance of `wrench`, shape (6, 6)."""
    other: float = 0.0
    """Probability that it is none of `contacts`: no single push, or one too improbable to be listed."""
    reason: str = ""
    """Why the status is what it is, where that is not plain: one sentence for a person."""
    events: tuple[Event, ...] = ()
    """What has just happened to contacts of the stream."""
    explanations: tuple[Explanation, ...] = ()
    """Where several contacts were looked for: sets of simultaneous contacts, most probable first; with
    `other` their probabilities add up to one."""
