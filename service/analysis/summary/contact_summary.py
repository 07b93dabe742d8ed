"""One contact of a recording, from onset to release."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Force of one contact over time, reduced to a few hundred points."""

    t: np.ndarray
    """Time on the robot's clock [s], shape (K,)."""
    force: np.ndarray
    """Magnitude of the force, the maximum between two points [N], shape (K,). NaN: not known since the
    point before."""


@dataclass(frozen=True, eq=False)
class ContactSummary:
    """A contact as a whole. Base frame and base axes unless stated otherwise."""

    recording: str
    """The file."""
    row: int
    """Row of its first sample in that file, from 0."""
    row_end: int
    """Row after its last sample."""
    contact: int
    """Its number in the recording, from 1."""
    begin: float
    """Time of its first sample on the robot's clock [s]."""
    duration: float
    """From its first to its last sample [s]."""
    complete: bool
    """Whether the recording contains its end."""
    link: str
    """The most probable link; empty where no single push on a touchable link explains the contact."""
    link_index: int
    """Its number, the base being 0; -1 for none."""
    probability: float
    """Probability of this link and place."""
    link_probability: np.ndarray
    """Probability of each link; the remainder to one is the probability of none of them, shape (links,)."""
    point: np.ndarray
    """Contact point in the link's frame [m], shape (3,)."""
    point_base: np.ndarray
    """Contact point in the base frame at the time of the largest force [m], shape (3,)."""
    normal_base: np.ndarray
    """Outward unit normal of the link there at that time, shape (3,)."""
    covariance: np.ndarray
    """Covariance of `point_base` [m^2], shape (3, 3)."""
    force_base: np.ndarray
    """The largest force on the robot [N], shape (3,)."""
    peak_force: float
    """Its magnitude [N]."""
    peak_time: float
    """Time at which it acted [s]."""
    transient_force: float
    """Largest force in the first half second [N]."""
    quasi_static_force: float
    """Largest force after the first half second [N]; 0 for shorter contacts."""
    impulse: float
    """Integral of the magnitude of the force over time [N s]."""
    torsion: float
    """Moment on the robot about the outward normal at the time of the largest force [Nm]; NaN without a
    link."""
    speed: float
    """Speed of the arm at the contact point when the contact began [m/s]; NaN without a link."""
    slides: bool
    """Whether the contact point moved for longer than it was at rest."""
    energy: float
    """Largest energy of the no-contact hypothesis during the contact."""
    q: np.ndarray
    """Joint positions at the time of the largest force [rad], shape (n,)."""
    silent: float = 0.0
    """Time within it for which the base sensor or the joint torques were silent or settled [s]: its forces
    are those of the other samples, or of the other sensors alone."""
    smoothed: bool = False
    """Whether link, place and probabilities were determined from the whole contact."""
    curve: ForceCurve = field(default_factory=lambda: ForceCurve(np.empty(0), np.empty(0)), repr=False)
    """Its force over time."""

    def __repr__(self) -> str:
        where = f"{self.link} at ({millimetres(self.point)}) mm" if self.link else "no single place"
        return (
            f"<contact {self.contact} at {self.begin:.3f} s for {self.duration:.2f} s: {where}, "
            f"{self.peak_force:.1f} N, P = {self.probability:.2f}>"
        )


def millimetres(point: np.ndarray) -> str:
    """A place, shape (3,) [m], in whole mm, without the sign of a zero."""
    return ", ".join(f"{1e3 * x:z.0f}" for x in point)
