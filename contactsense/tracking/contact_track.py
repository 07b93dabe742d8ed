"""State of a contact over time: its phase, and the windows over which its residuals are averaged."""

import math
from typing import Annotated, NamedTuple

from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import kernel

WINDOWS = 6
"""Number of windows, including the observer's own."""
NONE, NEW, HOLD, SLIDE = 0, 1, 2, 3
"""Phases of a contact."""


@record
class ContactStatus:
    """Phase of the current contact."""

    phase: int
    number: int
    """Id of the contact, or of the last one."""
    count: int
    """Ids given so far."""
    age: float
    """[s]"""
    time_since_slide: float
    """Time since it last moved [s]."""
    window: int
    """Index of the window in use."""
    magnitude: float
    """Present magnitude of the force over that in the window in use; 1 with a base sensor, which measures the
    present force."""
    sensors: int
    """Code of the sensors whose residuals are in the windows."""
    above_onset: bool
    """Whether the last sample was above the onset threshold."""
    sustained: bool
    """Whether only the residuals' EWMA shows the contact."""
    peak_energy: float
    """Highest energy of the no-contact hypothesis from a single sample of the contact, or of the last one."""
    last_body: int
    """Index of the body of the last estimate; -1: there was none."""
    time_since_end: float
    """Time since the last contact ended [s]; infinite if it cannot resume."""


@record
class Window:
    """Content of one window, and where the line of action of its mean meets the tangent plane at the point of
    the last estimate."""

    samples: float
    """Number of samples in it."""
    variance_ratio: float
    """Variance of its mean over that of one sample's white noise."""
    residual_covariance: float
    """Covariance of its mean with the newest residual, in the same unit."""
    age: float
    """Mean age of its content, weighted by the base sensor's force, the observer's lag included [s]."""
    x: float
    """Position along the first tangent from the last point [m]."""
    y: float
    """Along the second one [m]."""
    normal_force: float
    """Force along the outward normal, negative where it pushes [N]."""
    moment_xx: float
    moment_xy: float
    moment_yy: float
    """Covariance of the moment of its mean about the last point, tangential components, from noise
    [N^2 m^2]."""


class ContactTrack(NamedTuple):
    """State of the current contact."""

    mean: Annotated[Floats, f"{WINDOWS}, 6 * (joints + 1) + 2 * joints + 12 * link_sensors"]
    """Window means of the residuals, see `contactsense.residuals.observers.concatenate_residuals`."""
    windows: Annotated[Records[Window], f"{WINDOWS}"]
    last_point: Annotated[Floats, "3"]
    """Point of the last estimate, in the frame of its body [m]."""
    last_normal: Annotated[Floats, "3"]
    """Its outward normal, in the same frame."""
    link_weight: Annotated[Floats, "links"]
    """Sum of each link's probability over the samples of the contact, or of the last one, weighted by their
    energies."""
    status: Annotated[Records[ContactStatus], "1"]


@kernel
def end_contact(track: ContactTrack) -> None:
    """End the contact, which cannot resume; ids continue."""
    status = track.status[0]
    status.phase, status.window, status.above_onset, status.last_body = NONE, 0, False, -1
    status.sustained = False
    status.age, status.time_since_slide, status.time_since_end = 0.0, 0.0, math.inf
