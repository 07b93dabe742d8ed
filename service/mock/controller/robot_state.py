"""State of the simulated controller and its sensors at one instant."""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np


class RuntimeState(IntEnum):
    """State of the program, with the numbers of RTDE."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class Reading(NamedTuple):
    """The controller's state and the sensors' readings at one instant; n joints."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    target: np.ndarray
    """Target positions, velocities and accelerations, shape (3, n)."""
    torque: np.ndarray
    """Torque signal: the actuators' torques as the cell's sensors measure them, shape (n,) [Nm]."""
    model_torque: np.ndarray
    """Torques from the controller's own model, in the same form, shape (n,) [Nm]."""
    external_torque: np.ndarray
    """Joint torques due to contacts, shape (n,) [Nm]."""
    base: np.ndarray
    """Reading of the sensor under the base, shape (6,) [N, Nm]."""
    wrist: np.ndarray
    """Reading of the sensor at the flange, shape (6,) [N, Nm]."""
    links: Mapping[str, np.ndarray]
    """Readings of the cell's further sensors within the arm, by name, shape (6,) [N, Nm]."""
    external: np.ndarray
    """Total wrench of all contacts: force, moment about the base origin, shape (6,) [N, Nm]."""
    rotations: np.ndarray
    origins: np.ndarray
    """Poses of the links, base frame, shapes (B, 3, 3) and (B, 3) [m]."""
    twist: np.ndarray
    """Linear and angular velocity of the last joint's link, shape (6,) [m/s, rad/s]."""
    runtime: RuntimeState
    protective: bool
    """Whether a protective stop is active."""
    speed: float
    """Present fraction of the trajectory's own speed."""
    slider: float
    """Value of the speed slider."""
    deviation: float
    """Deviation from the target as a fraction of the limit for a protective stop."""
    collision: float
    """External force as a fraction of the limit for a protective stop."""
