"""Error of the residual of a force/torque sensor because of the joint velocities: their noise, and because
they are not of the same instant as the wrench.

Both appear in the second difference D of the momentum h, the change of dh/dt from one step to the next.

- **Noise.** White noise of h with covariance S appears in the residual r = K (h - integral) as K^2 S at most,
  since the integral changes little in a step. D then has the covariance
  S (2 / dt^2 + 2 / dt0^2 + 2 / (dt dt0)) for steps dt0 and dt. S is followed as the average of D D^T over
  `NOISE_TIME`. In the residual of a good sensor this noise is larger than the sensor's own: real velocities
  have about 0.001 rad/s.
- **Onset of noise.** It begins when the arm does, and the first few D D^T have too few directions. Where
  the average of |D|^2, in units of the sensor's noise, is less than `PEAK_SHARE` of the largest within
  `PEAK_TIME`, the difference counts in all directions alike.
- **Instants.** When dh/dt changes by D at once, as in a hard stop or at the end of a ramp of the speed, the
  covariance C grows as in `contactsense.residuals.timing_error`:

      C <- a^2 C + (K dt)^2 x D D^T / 12,    a = exp(-K dt).

  x is the part of |D|^2 that exceeds its average: the rest is noise.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from contactsense.residuals.timing_error import decay_and_gain
from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import inlined_kernel

NOISE_TIME = 0.1
"""Time constant of the average of D D^T [s]: many samples, and short beside changes of the motion."""
PEAK_SHARE, PEAK_TIME = 0.5, 0.02
"""The mean of |D|^2 over its largest value within this time [s], of noise of many dimensions."""


@record
class TimingHistory:
    """What is known of the samples so far."""

    samples: int
    """Number of samples since the start."""
    step: float
    """Last step [s]."""
    mean_square: float
    """Average of |D|^2, in units of the sensor's noise."""
    peak_square: float
    """Largest |D|^2 of late, which decays within `PEAK_TIME`."""
    isotropic: float
    """Variance of each component of h, in units of the sensor's noise, beyond S [s^2]."""


class WrenchTimingError(NamedTuple):
    """State for one force/torque sensor; wrenches in base axes about the base origin."""

    momentum: Annotated[Floats, "6"]
    """h of what the sensor carries, at the last sample [Ns, Nms]."""
    rate: Annotated[Floats, "6"]
    """Its change per time up to that sample [N, Nm]."""
    change: Annotated[Floats, "6"]
    """D at that sample [N, Nm]."""
    noise_covariance: Annotated[Floats, "6, 6"]
    """S, covariance of the momentum's noise [N^2 s^2, N Nm s^2, Nm^2 s^2]."""
    instant_covariance: Annotated[Floats, "6, 6"]
    """C, covariance of the residual due to the instants of the samples [N^2, N Nm, Nm^2]."""
    covariance: Annotated[Floats, "6, 6"]
    """That of the present residual, from both, or zero for a single measurement."""
    history: Annotated[Records[TimingHistory], "1"]


@inlined_kernel
def advance_wrench_timing_error(
    state: WrenchTimingError,
    momentum: np.ndarray,
    variances: tuple[float, float],
    dt: float,
    bandwidth: float,
) -> None:
    """Process the momentum of one sample, of what a force/torque sensor carries.

    Args:
        state: Changed in place.
        momentum: h in base axes about the base origin, shape (6,) [Ns, Nms]; not read without a wrench.
        variances: Of the sensor's noise, of each component of force [N^2] and moment [Nm^2].
        dt: Time since the last sample [s]; 0 restarts, negative: no wrench in this sample.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    history = state.history[0]
    if dt == 0.0:
        history.samples, history.mean_square, history.peak_square = 0, 0.0, 0.0
        history.isotropic = 0.0
        state.noise_covariance[:] = 0.0
        state.instant_covariance[:] = 0.0
    if dt >= 0.0:
        _fill_change(state, momentum, dt)
    if dt > 0.0 and history.samples >= 2:
        _add_change(state, variances, dt, bandwidth)
    if dt >= 0.0:
        history.samples += 1
        history.step = dt
    K = 2.0 * math.pi * bandwidth
    for i in range(6):
        S, C, out = state.noise_covariance[i], state.instant_covariance[i], state.covariance[i]
        for k in range(6):
            out[k] = K * K * S[k] + C[k]
        out[i] += K * K * history.isotropic * variances[i // 3]


@inlined_kernel
def _fill_change(state: WrenchTimingError, momentum: np.ndarray, dt: float) -> None:
    """D of a sample; of the second one it is not known."""
    known = dt > 0.0 and state.history[0].samples >= 1
    for i in range(6):
        rate = (momentum[i] - state.momentum[i]) / dt if known else 0.0
        state.change[i] = rate - state.rate[i]
        state.rate[i], state.momentum[i] = rate, momentum[i]


@inlined_kernel
def _add_change(
    state: WrenchTimingError, variances: tuple[float, float], dt: float, bandwidth: float
) -> None:
    """Let D of the newest sample count towards both covariances."""
    history, D = state.history[0], state.change
    forces = (D[0] * D[0] + D[1] * D[1] + D[2] * D[2]) / variances[0]
    square = forces + (D[3] * D[3] + D[4] * D[4] + D[5] * D[5]) / variances[1]
    excess = max(1.0 - history.mean_square / square, 0.0) if square > 0.0 else 0.0
    decay, gain = decay_and_gain(dt, bandwidth)
    gain *= excess
    kept = math.exp(-dt / NOISE_TIME)
    step = history.step
    of_momentum = 1.0 / (2.0 / (dt * dt) + 2.0 / (step * step) + 2.0 / (dt * step))
    share = (1.0 - kept) * of_momentum
    history.mean_square = kept * history.mean_square + (1.0 - kept) * square
    history.peak_square = max(math.exp(-dt / PEAK_TIME) * history.peak_square, square)
    beyond = max(PEAK_SHARE * history.peak_square - history.mean_square, 0.0)
    history.isotropic = beyond / 6.0 * of_momentum
    for i in range(6):
        S, C = state.noise_covariance[i], state.instant_covariance[i]
        for k in range(6):
            product = D[i] * D[k]
            S[k] = kept * S[k] + share * product
            C[k] = decay * C[k] + gain * product


@inlined_kernel
def of_link_sensor(states: WrenchTimingError, number: int) -> WrenchTimingError:
    """The state of one of several sensors, from arrays with a leading axis."""
    history: Any = states.history[number]
    return WrenchTimingError(
        states.momentum[number],
        states.rate[number],
        states.change[number],
        states.noise_covariance[number],
        states.instant_covariance[number],
        states.covariance[number],
        history,
    )
