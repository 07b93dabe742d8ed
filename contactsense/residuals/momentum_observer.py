"""Momentum observer: external joint torques and external base wrench without accelerations (A. De Luca, R.
Mattone, "Sensorless robot collision detection and hybrid force/motion control", ICRA 2005).

Joints and sensors obey equations of one form, dh/dt = drift + external, with h = s_j . H_j for a joint and h
= H_0 for the base. One first-order observer serves all, with one gain K = 2 pi bandwidth:

    dr/dt = K (external - r),   solved over one step, with a = exp(-K dt), as

    r1 = a r0 + K (h1 - a h0) - K integral( exp(-K (t1 - t)) g(t) dt ),    g = K h + drift.

That is exact except for the integral, for which g is the cubic through its last four samples at any spacing.
Where a sample is late (the steps before it are much shorter than its own) a cubic would amplify noise: there
g is a straight line. The sample rate need not be constant, and every dt is stable.

The variance of the residual due to the noise of single samples depends on the steps too.
`SampleHistory` propagates it, so that the covariance is right for streams with jitter and gaps as
well.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.kernel import inlined_kernel, kernel

_SERIES_TOLERANCE = 1e-18
"""Terms of a series about 1/4 below this are negligible."""
_MIN_STEP_RATIO = 0.45
"""A sample is late, and g linear, where a step before is shorter than this fraction of the new one."""


@record
class SampleHistory:
    """What an observer knows of the samples so far; the same for all its equations."""

    samples: int
    """Number of samples since the start."""
    step: float
    """Last step [s]."""
    step_before: float
    """The one before [s]."""
    variance_ratio: float
    """Variance of the residual over that of white noise in the measurement."""
    covariance_0: float
    """Covariance of the residual with the noise of the last sample, in the same unit."""
    covariance_1: float
    """The same for the sample before."""
    covariance_2: float
    """The same for the one before that."""


class MomentumObserver(NamedTuple):
    """State of one group of k equations that are sampled together."""

    momentum: Annotated[Floats, "equations"]
    """h at the last sample [Nms for joints; Ns and Nms for a sensor]."""
    integrand: Annotated[Floats, "3, equations"]
    """g at the last three samples, the latest first."""
    residual: Annotated[Floats, "equations"]
    """Low-passed external part: s_j . w of contacts distal to each joint [Nm], or the wrench w [N, Nm]."""
    history: Annotated[Records[SampleHistory], "1"]


def empty_observer(size: int) -> MomentumObserver:
    """State before the first sample, for that many equations."""
    return zeros(MomentumObserver, equations=size)


@inlined_kernel
def group_of(state: MomentumObserver, group: int) -> MomentumObserver:
    """One of several groups that are sampled at their own times, from arrays with a leading axis."""
    history: Any = state.history[group]
    return MomentumObserver(state.momentum[group], state.integrand[group], state.residual[group], history)


@inlined_kernel
def copy_history(source: MomentumObserver, target: MomentumObserver) -> None:
    """Give a group the history of another one that has had the same samples."""
    target.history[0] = source.history[0]


def noise_variance_ratio(bandwidth: float, dt: float) -> float:
    """Variance of the residual over that of white noise in the measurement, at constant sample time [s]."""
    state = empty_observer(0)
    for i in range(4 + math.ceil(20.0 / (2.0 * math.pi * bandwidth * dt))):
        start_step(state, dt if i else 0.0, bandwidth)
    return state.history[0].variance_ratio


class Step(NamedTuple):
    """What `start_step` gives to `advance`, the same for all equations of a group."""

    a: float
    """Factor by which the residual decays in the step."""
    b0: float
    """K dt times the weight of g at the new sample; 0 restarts ..."""
    b1: float
    """... and at the last sample ..."""
    b2: float
    """... and at the one before ..."""
    b3: float
    """... and at the one before that."""
    K: float
    """[1/s]"""


@kernel
def _moments(k: float) -> tuple[float, float, float, float]:
    """Integrals of s^n exp(-k (1 - s)) over s from 0 to 1, n = 0..3."""
    if k > 2.0:
        m0 = -math.expm1(-k) / k
        m1 = (1.0 - m0) / k
        m2 = (1.0 - 2.0 * m1) / k
        return m0, m1, m2, (1.0 - 3.0 * m2) / k
    # The recursion above loses digits as k -> 0; the downward recursion from a series does not.
    term, m3 = 0.25, 0.25
    for i in range(5, 26):
        term *= -k / i
        m3 += term
        if abs(term) < _SERIES_TOLERANCE:
            break
    m2 = (1.0 - k * m3) / 3.0
    m1 = (1.0 - k * m2) / 2.0
    return 1.0 - k * m1, m1, m2, m3


@kernel
def start_step(state: MomentumObserver, dt: float, bandwidth: float) -> Step:
    """Start a step of dt [s] for all equations of a group and update its history; dt = 0 restarts the
    group."""
    history = state.history[0]
    K = 2.0 * math.pi * bandwidth
    if dt <= 0.0:
        history.samples = 1
        history.step, history.step_before, history.variance_ratio = 0.0, 0.0, 0.0
        history.covariance_0, history.covariance_1, history.covariance_2 = 0.0, 0.0, 0.0
        return Step(0.0, 0.0, 0.0, 0.0, 0.0, K)
    k = K * dt
    a = math.exp(-k)
    m0, m1, m2, m3 = _moments(k)
    b0, b1, b2, b3 = m1, m0 - m1, 0.0, 0.0
    if (
        history.samples >= 3
        and history.step >= _MIN_STEP_RATIO * dt
        and history.step_before >= _MIN_STEP_RATIO * dt
    ):
        # Newton's form of the cubic through the nodes 1, 0, -p, -q, in units of dt.
        p = history.step / dt
        q = p + history.step_before / dt
        second = m2 - m1
        third = m3 - m2 + p * second
        b0 += second / (1.0 + p) + third / ((1.0 + p) * (1.0 + q))
        b1 -= second / p + third / (p * q)
        b2 = second / (p * (1.0 + p)) + third / (p * (1.0 + p) * (q - p))
        b3 = -third / (q * (1.0 + q) * (q - p))
    b0 *= k
    b1 *= k
    b2 *= k
    b3 *= k
    ratio = history.variance_ratio
    c0, c1, c2 = history.covariance_0, history.covariance_1, history.covariance_2
    # White noise n of the samples propagates as r1 = a r0 - b0 n1 - b1 n0 - ...
    history.variance_ratio = (
        a * a * ratio
        + b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3
        - 2.0 * a * (b1 * c0 + b2 * c1 + b3 * c2)
    )  # fmt: skip
    history.covariance_0, history.covariance_1, history.covariance_2 = -b0, a * c0 - b1, a * c1 - b2
    history.samples += 1
    history.step_before = history.step
    history.step = dt
    return Step(a, b0, b1, b2, b3, K)


@inlined_kernel
def in_step(state: MomentumObserver, other: MomentumObserver) -> bool:
    """Whether two groups have had the same steps, so that `start_step` gives the same for both."""
    one, two = state.history[0], other.history[0]
    return (
        one.samples == two.samples
        and one.step == two.step
        and one.step_before == two.step_before
        and one.variance_ratio == two.variance_ratio
        and one.covariance_0 == two.covariance_0
        and one.covariance_1 == two.covariance_1
        and one.covariance_2 == two.covariance_2
    )


@inlined_kernel
def advance(
    state: MomentumObserver,
    i: int,
    momentum: float,
    drift: float,
    step: Step,
) -> None:
    """Advance equation i: `momentum` is h, `drift` the known part of dh/dt at the new sample; `step` is the
    result of `start_step`."""
    a, b0, b1, b2, b3, K = step
    g = K * momentum + drift
    integrand = state.integrand
    if b0 > 0.0:
        state.residual[i] = (
            a * state.residual[i]
            + K * (momentum - a * state.momentum[i])
            - (b0 * g + b1 * integrand[0, i] + b2 * integrand[1, i] + b3 * integrand[2, i])
        )
    else:
        state.residual[i] = 0.0
    integrand[2, i], integrand[1, i], integrand[0, i] = integrand[1, i], integrand[0, i], g
    state.momentum[i] = momentum


@kernel
def advance_all(state: MomentumObserver, momentum: np.ndarray, drift: np.ndarray, step: Step) -> None:
    """`advance` for all k equations; `momentum`, `drift`: shape (k,).

    The formula stands here again, without a branch and with the rows of the state as arrays of their own:
    only so is it compiled to vector instructions, which take a quarter of the time.
    """
    a, b0, b1, b2, b3, K = step
    residual, last = state.residual, state.momentum
    g0, g1, g2 = state.integrand[0], state.integrand[1], state.integrand[2]
    if b0 <= 0.0:
        for i in range(residual.shape[0]):
            advance(state, i, momentum[i], drift[i], step)
        return
    for i in range(residual.shape[0]):
        g = K * momentum[i] + drift[i]
        residual[i] = (
            a * residual[i]
            + K * (momentum[i] - a * last[i])
            - (b0 * g + b1 * g0[i] + b2 * g1[i] + b3 * g2[i])
        )
        g2[i], g1[i], g0[i] = g1[i], g0[i], g
        last[i] = momentum[i]
