"""The momentum observers of one stream."""

from typing import Annotated, NamedTuple

from contactsense.residuals.momentum_observer import MomentumObserver
from contactsense.robots.jit.declaration import Sized


class Observers(NamedTuple):
    """One group of equations for each sensor, and one for each difference between two sensors."""

    base: Annotated[MomentumObserver, Sized(equations="6 * (joints + 1)")]
    """Residual of the base sensor in the frame of each body."""
    joints: Annotated[MomentumObserver, Sized(equations="joints")]
    """Residual of each joint torque."""
    torque_difference: Annotated[MomentumObserver, Sized(equations="joints")]
    """Residual of each joint torque minus the torque that the base wrench predicts."""
    links: Annotated[MomentumObserver, Sized("link_sensors", equations="6")]
    """Residual of each of the link sensors, base axes."""
    link_difference: Annotated[MomentumObserver, Sized("link_sensors", equations="6")]
    """Residual of each link sensor minus that of the base sensor."""
