"""Error of residuals because velocity and torque, or wrench, of a sample are not of the same instant.

Both are known once in a sample interval, and each may be that of any instant in it: encoders average, drives
and links move against each other, values wait for the next packet, sensors have clocks of their own. Even at
one instant, what happens between two samples is known by interpolation only. While the momentum h changes
steadily, that does not matter: the observer forgets a constant offset in time. When dh/dt changes by D, as in
a hard stop or at the end of a ramp of the speed, an offset d puts K d D into the residual
r = K (h - integral), and this decays as the residual does. With d uniform over one interval dt and
independent for each sample, the variance follows

    v <- a^2 v + (K dt)^2 D^2 / 12,    a = exp(-K dt).

It has no parameter, and vanishes with the sample interval. A contact changes dh/dt too, but its torque stays
while this error decays. For wrenches, see `contactsense.residuals.wrench_velocity_error`.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import inlined_kernel

_UNIFORM_VARIANCE = 1.0 / 12.0
"""Variance of a uniform distribution over an interval of length 1."""


class TimingError(NamedTuple):
    """State for the torques of n joints."""

    momentum: Annotated[Floats, "joints"]
    """h of each joint at the last sample [Nms]."""
    rate: Annotated[Floats, "joints"]
    """Its change per time up to that sample [Nm]."""
    stream_variance: Annotated[Floats, "joints"]
    """Variance of each residual of the stream due to the instants of the samples [Nm^2]."""
    variance: Annotated[Floats, "joints"]
    """That of the present residuals: the same, or zero for a single measurement [Nm^2]."""
    samples: Annotated[Integers, "1"]
    """Number of samples since the start."""


@inlined_kernel
def advance_timing_error(state: TimingError, momentum: np.ndarray, dt: float, bandwidth: float) -> None:
    """Process the momenta of one sample.

    Args:
        state: Changed in place.
        momentum: h of each joint, `contactsense.residuals.momentum_observer.MomentumObserver.momentum` after
            the sample, shape (n,) [Nms].
        dt: Time since the last sample [s]; 0 restarts, negative: no torques in this sample.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    if dt == 0.0:
        state.samples[0] = 0
    decay, gain = decay_and_gain(dt, bandwidth)
    for j in range(momentum.shape[0]):
        if dt < 0.0:
            state.variance[j] = state.stream_variance[j]
            continue
        rate = (momentum[j] - state.momentum[j]) / dt if state.samples[0] >= 1 else 0.0
        change = rate - state.rate[j] if state.samples[0] >= 2 else 0.0
        variance = decay * state.stream_variance[j] + gain * change * change if dt > 0.0 else 0.0
        state.stream_variance[j], state.variance[j] = variance, variance
        state.rate[j] = rate
        state.momentum[j] = momentum[j]
    if dt >= 0.0:
        state.samples[0] += 1


@inlined_kernel
def decay_and_gain(dt: float, bandwidth: float) -> tuple[float, float]:
    """Factor of the variance in a step, and that of D^2 in it [s^2]."""
    step = 2.0 * math.pi * bandwidth * dt
    # After a gap longer than its time constant the observer has forgotten what was before.
    return math.exp(-2.0 * step), min(step, 1.0) ** 2 * _UNIFORM_VARIANCE
