"""The momentum observers of one stream."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    Step,
    copy_history,
    in_step,
    start_step,
)
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.declaration import Sized
from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.sensors.stream_state import BASE, TORQUE, TORQUE_DIFFERENCE


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


@inlined_kernel
def start_steps(observers: Observers, steps: np.ndarray, bandwidth: float) -> tuple[Step, Step, Step]:
    """Start the step of base sensor, joint torques and their difference.

    Args:
        observers: Their histories are updated.
        steps: `contactsense.sensors.stream_state.StreamState.steps`.
        bandwidth: Cut-off frequency of the observers [Hz].

    Returns:
        For each what `contactsense.residuals.momentum_observer.advance` takes; all zero without a value.
    """
    base, joints, difference = observers.base, observers.joints, observers.torque_difference
    dt = steps[BASE]
    # Sensors that came with the same samples need the weights of a step once.
    joints_alike = steps[TORQUE] == dt and in_step(joints, base)
    difference_alike = steps[TORQUE_DIFFERENCE] == dt and in_step(difference, base)
    of_base = of_joints = of_difference = Step(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if dt >= 0.0:
        of_base = start_step(base, dt, bandwidth)
    if steps[TORQUE] >= 0.0:
        if joints_alike:
            of_joints = of_base
            copy_history(base, joints)
        else:
            of_joints = start_step(joints, steps[TORQUE], bandwidth)
    if steps[TORQUE_DIFFERENCE] >= 0.0:
        if difference_alike:
            of_difference = of_base
            copy_history(base, difference)
        else:
            of_difference = start_step(difference, steps[TORQUE_DIFFERENCE], bandwidth)
    return of_base, of_joints, of_difference


@kernel
def concatenate_residuals(out: np.ndarray, observers: Observers) -> None:
    """Concatenate the observers' residuals, see `ResidualParts`."""
    index = 0
    for part in (
        observers.base.residual,
        observers.torque_difference.residual,
        observers.joints.residual,
    ):
        for i in range(part.shape[0]):
            out[index] = part[i]
            index += 1
    for parts in (observers.link_difference.residual, observers.links.residual):
        for s in range(parts.shape[0]):
            for i in range(6):
                out[index] = parts[s, i]
                index += 1


class ResidualParts(NamedTuple):
    """The parts of concatenated residuals, of observers or of a mean, in the order of the concatenation."""

    base: np.ndarray
    """External wrench on the base sensor in the frame of each body, shape (6 (n + 1),) [N, Nm]."""
    torque_difference: np.ndarray
    """Of each joint torque minus the torque that the base wrench predicts, shape (n,) [Nm]."""
    torque: np.ndarray
    """Of each joint torque, shape (n,) [Nm]."""
    link_difference: np.ndarray
    """Of each link sensor minus that of the base sensor, base axes, shape (S, 6) [N, Nm]."""
    link_wrench: np.ndarray
    """Of each link sensor, base axes, shape (S, 6) [N, Nm]."""


@inlined_kernel
def parts_of(residuals: np.ndarray, joints: int, link_sensors: int) -> ResidualParts:
    """Views of the parts of concatenated residuals."""
    torque, link_wrench = first_torque(joints), first_link_wrench(joints, link_sensors)
    torque_difference, link_difference = torque - joints, torque + joints
    return ResidualParts(
        residuals[:torque_difference],
        residuals[torque_difference:torque],
        residuals[torque:link_difference],
        view(residuals, link_difference, (link_sensors, 6)),
        view(residuals, link_wrench, (link_sensors, 6)),
    )


@inlined_kernel
def current_parts(observers: Observers) -> ResidualParts:
    """The residuals of the observers themselves, which are not concatenated."""
    return ResidualParts(
        observers.base.residual,
        observers.torque_difference.residual,
        observers.joints.residual,
        observers.link_difference.residual,
        observers.links.residual,
    )


@kernel
def first_torque(joints: int) -> int:
    """Index of the first torque among the concatenated residuals."""
    return 6 * (joints + 1) + joints


@kernel
def first_link_wrench(joints: int, link_sensors: int) -> int:
    """Index of the first component of the link sensors' wrenches among the concatenated residuals."""
    return first_torque(joints) + joints + 6 * link_sensors
