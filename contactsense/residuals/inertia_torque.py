"""Inertia torque of each joint, low-passed as its residual is, for the error that grows with it.

Inertia of links and rotors is known to a few per cent, and what bends or slips in a drive shows when the arm
accelerates. So the error of a joint's torque has a part in proportion to the rate dh/dt of the joint's
momentum h, beside the part that is the same in any motion. The momentum is known from the velocities, so its
rate needs no accelerations. At rest and at constant velocity there is none.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import inlined_kernel


class InertiaTorque(NamedTuple):
    """State for n joints."""

    of_stream: Annotated[Floats, "joints"]
    """Low-passed dh/dt of the stream [Nm]."""
    present: Annotated[Floats, "joints"]
    """That of the present residuals: the same, or zero for a single measurement [Nm]."""


@inlined_kernel
def follow_inertia_torque(state: InertiaTorque, rate: np.ndarray, dt: float, bandwidth: float) -> None:
    """Process one sample.

    Args:
        state: Changed in place.
        rate: `contactsense.residuals.timing_error.TimingError.rate` after the sample, shape (n,) [Nm].
        dt: Time since the last sample [s]; 0 restarts, negative: no torques in this sample.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    a = math.exp(-2.0 * math.pi * bandwidth * dt) if dt > 0.0 else 0.0
    for j in range(rate.shape[0]):
        if dt >= 0.0:
            state.of_stream[j] = rate[j] + a * (state.of_stream[j] - rate[j])
        state.present[j] = state.of_stream[j]
