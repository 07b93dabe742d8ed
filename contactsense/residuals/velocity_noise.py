"""Noise of the joint velocities, and sudden changes of the accelerations, from the velocities themselves.

Both appear in the second difference of a joint's velocity. With D the change of its acceleration from one
step to the next, white noise of variance v in the velocity gives D the variance

    g v,    g = 2 / dt^2 + 2 / dt0^2 + 2 / (dt dt0)    for steps dt0 and dt.

- **Noise.** D^2 / g is followed as v, as an average over `NOISE_TIME`. What exceeds `LARGEST_DEVIATION`
  standard deviations of it does not count.
- **Sudden changes**, as in a hard stop or at the end of a ramp of the speed. They come in all joints at once,
  and are longer than noise that they are no larger than: an error of up to dt in time makes the velocity
  wrong by D dt, twice as much as noise of the same D. So with Q the sum of D^2 / (g v) over the n joints that
  move, the share 1 - n / Q of D^2 counts as a change of the accelerations, if it is positive.
- **Noise that comes back.** A joint that creeps may report velocities without noise, and v vanishes. So the
  usual noise u is kept, too: it rises as fast as v, falls `USUAL_TIME` times as slowly, and not at all while
  v is far below it. With the first D that is more than `RETURN_DEVIATION` standard deviations of v, v is u
  again.

A joint at rest reports zero velocity, so it has no noise, and g has fewer terms in the first two samples
after rest, in which the motion begins: they do not count in the average. When a joint moves again, it begins
with the noise that it had. When it moves for the first time, all of D is noise, up to `LARGEST_FIRST_NOISE`,
and until enough samples are known the largest of them counts, of all joints that move for the first time.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Integers, Records, record
from contactsense.robots.jit.kernel import inlined_kernel

NOISE_TIME = 0.1
"""Time constant of the average [s]: many samples, and short beside changes of the motion."""
LARGEST_DEVIATION = 3.0
"""Standard deviations of D that count as noise."""
FIRST_SAMPLES = 10.0
"""Number of samples up to which all of D is noise. No average is over fewer, however long the steps are: it
could be much too small by chance."""
LARGEST_FIRST_NOISE = 0.03
"""Standard deviation of the velocity that the first samples can show [rad/s]. More is a wrong value, which a
joint that is at rest afterwards would remember."""
RETURN_DEVIATION = 5.0
"""Standard deviations of D beyond which the usual noise is back: more than white noise has, so that noise
that has become less for good is not taken for the usual one. Noise that would exceed this when it comes back
has vanished: then u is kept."""
USUAL_TIME = 10.0
"""Time over which the usual noise falls, in units of `NOISE_TIME`: many motions have shorter pauses, and an
error of it is soon undone."""
REFRESH_TIME, REFRESH_CHANGE, REFRESH_SHARE = 0.01, 1.2, 0.8
"""What depends on the noise and the posture is worked out again after this time [s], when the sum of the
variances has changed by this factor, or for a change of the accelerations of which the share in D^2 is larger
than this. In twice the time a fast arm turns so far that the noise of its velocities has other directions
than are known, in which a sensor may be far more precise."""
LEAST_VARIANCE = 1e-30
"""Where velocities have no noise at all [rad^2/s^2]."""
RETURN_SQUARE = RETURN_DEVIATION**2
_NONE = (0.0, 0.0, 0.0)


@record
class VelocitySamples:
    """What is known of the samples so far."""

    count: int
    """Number of samples since the start."""
    step: float
    """Last step [s]."""
    age: float
    """Time since what depends on the noise was worked out [s]."""
    sum_then: float
    """Sum of the variances of the joints that moved then [rad^2/s^2]."""
    due: bool
    """Whether it is to be worked out again in this sample."""
    changes: bool
    """Whether accelerations have changed at once in this sample."""


class VelocityNoise(NamedTuple):
    """State for n joints."""

    velocity: Annotated[Floats, "joints"]
    """At the last sample [rad/s]."""
    acceleration: Annotated[Floats, "joints"]
    """Change of the velocity per time up to that sample [rad/s^2]."""
    variance: Annotated[Floats, "joints"]
    """v of each joint, when it last moved [rad^2/s^2]."""
    usual: Annotated[Floats, "joints"]
    """u of each joint: its noise where it has any [rad^2/s^2]."""
    present: Annotated[Floats, "joints"]
    """v in this sample: zero for a joint at rest [rad^2/s^2]."""
    moving: Annotated[Integers, "joints"]
    """Number of samples since the joint was at rest."""
    samples: Annotated[Floats, "joints"]
    """Number of samples that `variance` counts for."""
    change: Annotated[Floats, "joints"]
    """Sudden change of the acceleration at this sample, as far as it is no noise [rad/s^2]."""
    history: Annotated[Records[VelocitySamples], "1"]


@inlined_kernel
def follow_velocity_noise(state: VelocityNoise, qd: np.ndarray, dt: float) -> bool:
    """Process the velocities of one sample.

    Args:
        state: Changed in place.
        qd: Velocity of each joint, shape (n,) [rad/s].
        dt: Time since the last sample [s]; 0 restarts.

    Returns:
        `VelocitySamples.due`: whether the poses of this sample are needed.
    """
    history = state.history[0]
    if dt <= 0.0:
        history.count, history.age, history.sum_then = 0, 0.0, 0.0
        state.samples[:], state.variance[:], state.present[:] = 0.0, 0.0, 0.0
        state.usual[:] = 0.0
        state.moving[:] = 0
        state.velocity[:], state.acceleration[:] = 0.0, 0.0
    # 1 / dt, 1 / dt0, and the least weight of a sample.
    rates = _NONE
    if history.count >= 2:
        least_weight = min(-math.expm1(-dt / NOISE_TIME), 1.0 / FIRST_SAMPLES)
        rates = (1.0 / dt, 1.0 / history.step, least_weight)
    per_time = 1.0 / dt if history.count >= 1 else 0.0
    begins, moving, squares, largest = dt <= 0.0, 0, 0.0, 0.0
    for j in range(qd.shape[0]):
        state.change[j], before = 0.0, state.present[j]
        acceleration = (qd[j] - state.velocity[j]) * per_time
        # The acceleration of a joint that comes to rest may change after its velocity has vanished.
        if qd[j] == 0.0 and state.velocity[j] == 0.0 and state.acceleration[j] == 0.0:
            state.present[j], state.moving[j] = 0.0, 0
        else:
            state.moving[j] += 1
            if history.count >= 2:
                state.change[j] = acceleration - state.acceleration[j]
                squares += _follow_change(state, j, rates)
                moving += 1
        # Noise that comes back in one joint may be small in the sum, but is the only one in its direction.
        begins = begins or state.present[j] > REFRESH_CHANGE * before or state.present[j] == 0.0 < before
        if state.samples[j] < FIRST_SAMPLES:
            largest = max(largest, state.present[j])
        state.acceleration[j], state.velocity[j] = acceleration, qd[j]
    history.count += 1
    history.step = dt
    history.age += dt
    share = share_of_changes(squares, moving)
    history.changes = share > 0.0
    total = 0.0
    for j in range(qd.shape[0]):
        state.change[j] *= math.sqrt(share)
        if state.moving[j] > 0 and state.samples[j] < FIRST_SAMPLES:
            state.present[j] = largest
        total += state.present[j]
    then = history.sum_then
    history.due = (
        begins
        or share > REFRESH_SHARE
        or (total > 0.0 and history.age >= REFRESH_TIME)
        or total > REFRESH_CHANGE * then
        or total * REFRESH_CHANGE < then
    )
    if history.due:
        history.age, history.sum_then = 0.0, total
    return bool(history.due)


@inlined_kernel
def _follow_change(state: VelocityNoise, j: int, rates: tuple[float, float, float]) -> float:
    """Let D of joint j, which is in `change`, count towards its noise.

    Args:
        rates: 1 / dt and 1 / dt0 [1/s], and the least weight of a sample.

    Returns:
        D^2 / (g v).
    """
    newest, before, least_weight = rates
    square = state.change[j] * state.change[j] / noise_gain(newest, before, state.moving[j])
    first = state.samples[j] < FIRST_SAMPLES
    if not first and square > RETURN_SQUARE * state.variance[j]:
        state.variance[j] = max(state.variance[j], state.usual[j])
    known = state.variance[j]
    # Noise that had vanished for long can still grow from the least variance.
    largest = LARGEST_DEVIATION * LARGEST_DEVIATION * max(known, LEAST_VARIANCE)
    counted = min(square, LARGEST_FIRST_NOISE * LARGEST_FIRST_NOISE if first else largest)
    if state.moving[j] >= 3:
        state.samples[j] += 1.0
        weight = max(1.0 / state.samples[j], least_weight)
        state.variance[j] += weight * (counted - known)
        if not first and state.variance[j] * RETURN_SQUARE >= state.usual[j]:
            lasting = least_weight / USUAL_TIME if state.variance[j] < state.usual[j] else weight
            state.usual[j] += lasting * (counted - state.usual[j])
    if first:
        known = max(known, state.present[j], counted)
    state.present[j] = known if first else state.variance[j]
    return float(square / max(known, LEAST_VARIANCE))


@inlined_kernel
def noise_gain(newest: float, before: float, moving: int) -> float:
    """g, for 1 / dt and 1 / dt0 [1/s] and the number of samples since the joint was at rest."""
    g = newest * newest
    if moving >= 2:
        g += (newest + before) ** 2
    if moving >= 3:
        g += before * before
    return g


@inlined_kernel
def share_of_changes(squares: float, moving: int) -> float:
    """1 - n / Q, or 0, for `squares` = Q and `moving` = n."""
    return 1.0 - moving / squares if squares > moving else 0.0
