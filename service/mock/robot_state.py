"""What the simulated controller and its sensors say at an instant."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np


class RuntimeState(IntEnum):
    """What the program does, as RTDE numbers it."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class Reading(NamedTuple):
    """The controller's state at an instant, and what the sensors read; n joints."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    target: np.ndarray
    """Target positions, velocities and accelerations, shape (3, n)."""
    torque: np.ndarray
    """Torque signal: actuators' torques as the cell's sensor gives them, shape (n,) [Nm]."""
    model_torque: np.ndarray
    """What the controller's own model asks for, in the same terms, shape (n,) [Nm]."""
    external_torque: np.ndarray
    """What contacts put on the joints, shape (n,) [Nm]."""
    base: np.ndarray
    """Reading of the sensor under the base, shape (6,) [N, Nm]."""
    wrist: np.ndarray
    """Reading of the sensor at the flange, shape (6,) [N, Nm]."""
    external: np.ndarray
    """Sum of all contact forces: force, moment about the base origin, shape (6,) [N, Nm]."""
    rotations: np.ndarray
    origins: np.ndarray
    """Poses of the links, base frame, shapes (B, 3, 3) and (B, 3) [m]."""
    twist: np.ndarray
    """Velocity of the last joint's link, shape (6,) [m/s, rad/s]."""
    runtime: RuntimeState
    protective: bool
    """Whether a protective stop is active."""
    speed: float
    """Present share of the trajectory's own speed."""
    slider: float
    """What the speed slider says."""
    deviation: float
    """Share of the deviation that makes a protective stop."""
    collision: float
    """Share of the force that makes one."""
