"""Sudden changes of the accelerations over the steps of one force/torque sensor.

Those of a sensor with a value in each sample are in `contactsense.residuals.velocity_noise`. One that has
values less often, or has missed some, may be wrong in time by its own, longer step. Over the short steps of
the samples, the noise of a second difference times that long step would be many times that of the velocities.
So D is then the second difference over the sensor's last two steps, and judged in the same way.
"""

import math
from typing import Annotated, NamedTuple

from contactsense.residuals.velocity_noise import (
    LEAST_VARIANCE,
    VelocityNoise,
    noise_gain,
    share_of_changes,
)
from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import inlined_kernel


@record
class SensorValues:
    """What is known of the sensor's values so far."""

    count: int
    """Number of values since the start."""
    step: float
    """Last step between them [s]."""


class SensorStepChange(NamedTuple):
    """State for one sensor and n joints."""

    velocity: Annotated[Floats, "joints"]
    """At the sensor's last value [rad/s]."""
    acceleration: Annotated[Floats, "joints"]
    """Change of the velocity per time in the step up to it [rad/s^2]."""
    change: Annotated[Floats, "joints"]
    """Sudden change of the acceleration in that step, as far as it is no noise [rad/s^2]."""
    history: Annotated[Records[SensorValues], "1"]


@inlined_kernel
def follow_sensor_step(state: SensorStepChange, velocities: VelocityNoise, dt: float) -> bool:
    """Process a sample in which the sensor has a value.

    Args:
        state: Changed in place.
        velocities: After this sample.
        dt: Time since the sensor's last value [s]; 0 restarts.

    Returns:
        Whether `change` is not zero.
    """
    values, samples = state.history[0], velocities.history[0]
    if dt == 0.0:
        values.count = 0
    per_time = 1.0 / dt if values.count >= 1 else 0.0
    in_each_sample, known = dt == samples.step, values.count >= 2
    g = noise_gain(per_time, 1.0 / values.step, 3) if known else 0.0
    squares, moving = 0.0, 0
    for j in range(state.velocity.shape[0]):
        acceleration = (velocities.velocity[j] - state.velocity[j]) * per_time
        if in_each_sample:
            state.change[j] = velocities.change[j]
        else:
            state.change[j] = acceleration - state.acceleration[j] if known else 0.0
            if state.change[j] != 0.0:
                # A joint that has just come to rest has had noise in these steps.
                variance = max(velocities.variance[j], velocities.present[j], LEAST_VARIANCE)
                squares += state.change[j] * state.change[j] / (g * variance)
                moving += 1
        state.velocity[j], state.acceleration[j] = velocities.velocity[j], acceleration
    values.count += 1
    values.step = dt
    if in_each_sample:
        return bool(samples.changes)
    share = share_of_changes(squares, moving)
    for j in range(state.velocity.shape[0]):
        state.change[j] *= math.sqrt(share)
    return bool(share > 0.0)
