"""Error of the residual of a force/torque sensor because of the joint velocities: their noise, and because
they are not of the same instant as the wrench.

The momentum of what the sensor carries is h = sum a_j qd_j, with a_j that of a unit velocity of joint j
(`contactsense.kinematics.composite_inertia`).

- **Noise.** White noise of the velocities with the variances v_j appears in the residual r = K (h - integral)
  with the covariance K^2 S, S = sum v_j a_j a_j^T, and in its integral with the covariance L, which follows
  from that of the last value, S0:

      L <- a^2 L + (1 - a)^2 K^2 S0,    a = exp(-K dt).

  L is small beside K^2 S, but remains where joints have come to rest. In the residual of a good sensor this
  noise is larger than the sensor's own.
- **Instants.** When accelerations change at once by d_j, as in a hard stop or at the end of a ramp of the
  speed, dh/dt changes by D = sum a_j d_j, and the covariance C grows as in
  `contactsense.residuals.timing_error`:

      C <- a^2 C + (K dt)^2 D D^T / 12.

v_j is that of `contactsense.residuals.velocity_noise`, d_j that of
`contactsense.residuals.sensor_step_change`. S and a_j are worked out again where the first says so: they
change slowly.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from contactsense.kinematics.spatial import add_outer
from contactsense.residuals.sensor_step_change import SensorStepChange, follow_sensor_step
from contactsense.residuals.timing_error import decay_and_gain
from contactsense.residuals.velocity_noise import VelocityNoise
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import inlined_kernel

CORRELATION_TIME = 0.005
"""For how long the noise of velocities is correlated [s]. Samples of a real UR10e 10 ms apart are nearly
independent (`tests/contactsense/residuals/test_real_velocities.py`); shorter times have not been measured."""

_FORGOTTEN = 1e-20
"""Trace below which L and C are zero, far below any sensor's noise [N^2, Nm^2]: numbers that go on to
decay become denormal, and those take long."""


class WrenchVelocityError(NamedTuple):
    """State for one force/torque sensor; wrenches in base axes about the base origin."""

    unit_momentum: Annotated[Floats, "joints, 6"]
    """a_j [kg m, kg m^2]."""
    steps: SensorStepChange
    """d_j over the sensor's own steps."""
    change: Annotated[Floats, "6"]
    """Scratch: D [N, Nm]."""
    noise_covariance: Annotated[Floats, "6, 6"]
    """S, covariance of the momentum's noise [N^2 s^2, N Nm s^2, Nm^2 s^2]."""
    last_noise_covariance: Annotated[Floats, "6, 6"]
    """S0, S at the sensor's last value."""
    integrated_noise: Annotated[Floats, "6, 6"]
    """L [N^2, N Nm, Nm^2]."""
    instant_covariance: Annotated[Floats, "6, 6"]
    """C, covariance of the residual due to the instants of the samples [N^2, N Nm, Nm^2]."""
    noise: Annotated[Floats, "6, 6"]
    """K^2 S + L of the present residual, or zero for a single measurement."""
    instants: Annotated[Floats, "6, 6"]
    """C of the same."""


@inlined_kernel
def advance_wrench_velocity_error(
    state: WrenchVelocityError, velocities: VelocityNoise, dt: float, bandwidth: float
) -> None:
    """Process the velocities of one sample.

    Args:
        state: Changed in place. Where `velocities` says `due`, `unit_momentum` is that of this sample.
        velocities: After `contactsense.residuals.velocity_noise.follow_velocity_noise` for this sample.
        dt: Time since the sensor's last value [s]; 0 restarts, negative: no value in this sample.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    history, a = velocities.history[0], state.unit_momentum
    K = 2.0 * math.pi * bandwidth
    if history.due:
        state.noise_covariance[:] = 0.0
        for j in range(a.shape[0]):
            add_outer(state.noise_covariance, a[j], velocities.present[j])
    if dt >= 0.0:
        _integrate_noise(state, dt, bandwidth)
        _decay(state.instant_covariance, dt, bandwidth)
        if follow_sensor_step(state.steps, velocities, dt):
            _add_change(state, dt, bandwidth)
    for i in range(6):
        for k in range(6):
            state.noise[i, k] = K * K * state.noise_covariance[i, k] + state.integrated_noise[i, k]
            state.instants[i, k] = state.instant_covariance[i, k]


@inlined_kernel
def _integrate_noise(state: WrenchVelocityError, dt: float, bandwidth: float) -> None:
    """Let S0 count towards L, and keep S for the next value."""
    K = 2.0 * math.pi * bandwidth
    _decay(state.integrated_noise, dt, bandwidth)
    gain = math.expm1(-K * dt) ** 2 * K * K
    for i in range(6):
        for k in range(6):
            state.integrated_noise[i, k] += gain * state.last_noise_covariance[i, k]
            state.last_noise_covariance[i, k] = state.noise_covariance[i, k]


@inlined_kernel
def _decay(covariance: np.ndarray, dt: float, bandwidth: float) -> None:
    """In one step; a restart, dt = 0, forgets it."""
    trace = 0.0
    for i in range(6):
        trace += covariance[i, i]
    decay = decay_and_gain(dt, bandwidth)[0] if dt > 0.0 and trace > _FORGOTTEN else 0.0
    for i in range(6):
        for k in range(6):
            covariance[i, k] *= decay


@inlined_kernel
def _add_change(state: WrenchVelocityError, dt: float, bandwidth: float) -> None:
    """Let D count towards C."""
    state.change[:] = 0.0
    for j in range(state.unit_momentum.shape[0]):
        for i in range(6):
            state.change[i] += state.unit_momentum[j, i] * state.steps.change[j]
    add_outer(state.instant_covariance, state.change, decay_and_gain(dt, bandwidth)[1])


@inlined_kernel
def noise_share_in_average(share: float, bandwidth: float) -> float:
    """Variance of the velocities' noise in an average of residuals over that in a residual.

    Low-passed noise that is correlated for the time 1 / K has the share 1 / (1 + K T) in an exponentially
    weighted average over the time T; noise correlated for `CORRELATION_TIME` has less.

    Args:
        share: That of low-passed noise.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    correlation = min(2.0 * math.pi * bandwidth * CORRELATION_TIME, 1.0)
    return correlation * share / (correlation * share + max(1.0 - share, 0.0))


@inlined_kernel
def of_link_sensor(states: WrenchVelocityError, number: int) -> WrenchVelocityError:
    """The state of one of several sensors, from arrays with a leading axis."""
    steps = states.steps
    history: Any = steps.history[number]
    return WrenchVelocityError(
        states.unit_momentum[number],
        SensorStepChange(steps.velocity[number], steps.acceleration[number], steps.change[number], history),
        states.change[number],
        states.noise_covariance[number],
        states.last_noise_covariance[number],
        states.integrated_noise[number],
        states.instant_covariance[number],
        states.noise[number],
        states.instants[number],
    )
