"""Input and output of the localizer: `Sample` and `Estimate`.

Objects with arrays are compared by identity: NumPy compares arrays number by number.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from contactsense.robots.attribute_docs import with_attributes

Status = Literal["none", "contact", "ambiguous", "multiple", "degraded"]
Phase = Literal["", "new", "hold", "slide"]
"""Phase of a contact of a stream: new, at a constant position, or sliding; empty without a stream."""
EventKind = Literal["onset", "hold", "slide", "release", "resume", "weight"]


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class Sample:
    """Measurements at one instant, without the sensors' delays. A sensor that is absent, or without a value
    at this instant, is None. A number that is NaN or masked is no value.

    Wrenches are in base axes, whatever frame, sign and bias the scene states of a sensor:
    `contactsense.scene_model.wrench_map.WrenchMap` and `contactsense.scene_model.link_sensor_frame` convert
    readings.
    """

    t: float
    """Time of the measurement on the robot's clock [s]."""
    q: np.ndarray
    """Joint positions [rad], shape (n,)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (n,)."""
    joint_torque: np.ndarray | None = None
    """Torque of each actuator [Nm], shape (n,)."""
    base_wrench: np.ndarray | None = None
    """Wrench of the arm on the sensor below it, force then moment about the base origin, base axes [N, Nm],
    shape (6,)."""
    wrist_wrench: np.ndarray | None = None
    """Wrench on the wrist sensor of everything distal to it, force then moment about the base origin, base
    axes [N, Nm], shape (6,)."""
    link_wrenches: Mapping[str, np.ndarray | None] | None = None
    """The same of each further sensor within the arm, by its name in `Scene.link_wrenches`; None, or a name
    that is not there: no value."""


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class Contact:
    """One candidate for the contact: a point on a link and the force on it."""

    link: str
    """Name of the touched link."""
    link_index: int
    """Its index, the base being 0."""
    primitive: int
    """Index of the touched primitive among the link's own; pedestals add theirs to the base link's."""
    probability: float
    """Probability of this candidate, given the measurement."""
    point: np.ndarray
    """Contact centroid, link frame [m], shape (3,)."""
    point_base: np.ndarray
    """Contact centroid, base frame [m], shape (3,)."""
    normal_base: np.ndarray
    """Outward unit normal of the link at the point, base axes, shape (3,)."""
    force_base: np.ndarray
    """Force on the robot, base axes [N], shape (3,)."""
    torsion: float
    """Moment on the robot about the outward normal [Nm]."""
    covariance: np.ndarray
    """Covariance of `point_base`, base axes [m^2], shape (3, 3)."""
    id: int = 0
    """Number of the contact in its stream, from 1; candidates for the same contact share it. 0 without a
    stream."""
    phase: Phase = ""
    """Phase of the contact."""
    body: str = ""
    """Name of the scene's body that the contact is with: the pedestal that is touched (on the base link), or
    an obstacle that explains the contact; empty if there is none."""


@with_attributes
@dataclass(frozen=True, slots=True)
class Event:
    """A change of a contact in this sample."""

    kind: EventKind
    """`onset`: it began; `hold`: its position is constant; `slide`: it moves; `release`: it ended; `resume`:
    it has not ended after all, another `release` will follow; `weight`: it was a payload that was picked up
    or put down."""
    contact: int
    """Its number, see `Contact.id`."""
    t: float
    """Time of the sample [s]."""
    link: str = ""
    """The most probable link, if there is one."""
    mass: float = 0.0
    """Change of the payload's mass [kg]."""
    reason: str = ""
    """Of a `release`: why the end of the contact was not seen, as when a new stream begins; else empty."""


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """A set of simultaneous contacts that explains one measurement."""

    contacts: tuple[Contact, ...]
    """Each with its own probability: the sum over all explanations that contain it."""
    probability: float
    """Probability of exactly this set, given the measurement."""


@with_attributes
@dataclass(frozen=True, eq=False, slots=True)
class Estimate:
    """Result for one sample."""

    t: float
    """Time of the sample [s]."""
    status: Status
    """`none`: no contact; `contact`: one clear candidate; `ambiguous`: other candidates are not clearly
    worse; `multiple`: several simultaneous contacts; `degraded`: a sensor is missing or unusable, see
    `reason`."""
    contacts: tuple[Contact, ...]
    """Candidates, most probable first; with `other` their probabilities add up to one. Where a base sensor
    measures, those on one link are at places that differ significantly. Where there are `explanations`: the
    simultaneous contacts of the first of them, which may be a single one."""
    link_probability: np.ndarray
    """Probability that each link is touched, shape (n + 1,); zeros without contact. The remainder to one is
    the probability that it is not a single push on a touchable link: a pull, a couple, several contacts.
    If the status is `multiple`: probability that each link is touched, which may add up to more than one.
    """
    wrench: np.ndarray
    """External wrench on the arm for the best candidate, force then moment about the base origin, base axes
    [N, Nm], shape (6,); zeros without contact."""
    covariance: np.ndarray
    """Covariance of `wrench`, shape (6, 6); zeros without contact, where nothing is estimated."""
    other: float = 0.0
    """Probability of none of `contacts`: no single push, or a candidate too improbable to be reported."""
    reason: str = ""
    """Reason for the status if it is not obvious: one sentence."""
    events: tuple[Event, ...] = ()
    """Changes of the stream's contacts in this sample."""
    explanations: tuple[Explanation, ...] = ()
    """With several contacts enabled: sets of simultaneous contacts, most probable first; with `other` their
    probabilities add up to one. Of two contacts at once, a set that is known only as a pair of links is not
    the first one, unless no other is listed."""
    detectable: float = math.inf
    """Smallest force that the usable sensors detect with probability 0.9, wherever and in whichever direction
    it acts on the arm, while it is held [N]; infinite where no force is sure to be detected, as with joint
    torques alone. It is what the status `none` rules out."""
