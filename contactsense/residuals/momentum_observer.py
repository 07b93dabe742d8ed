"""Momentum observer: external joint torques and external base wrench without accelerations (theory, section
2).

Joints and sensors obey equations of one form, dh/dt = drift + external, with h = s_j . H_j for a joint and h
= H_0 for the base. One first-order observer serves all, with one gain K = 2 pi bandwidth:

    dr/dt = K (external - r),   solved over one step, with a = exp(-K dt), as

    r1 = a r0 + K (h1 - a h0) - K integral( exp(-K (t1 - t)) g(t) dt ),    g = K h + drift.

That is exact except for the integral, for which g is the cubic through its last four samples at any spacing.
Where a sample is late (the steps before it are much shorter than its own) a cubic would amplify noise: there
g is a straight line. The sample rate need not be constant, and every dt is stable.

The variance of the residual due to the noise of single samples depends on the steps too.
`MomentumObserver.scalars` propagates it, so that the covariance is right for streams with jitter and gaps as
well.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel, kernel

SAMPLES, STEP, STEP_BEFORE, VARIANCE_RATIO = 0, 1, 2, 3
"""Indices of `MomentumObserver.scalars`."""
_SERIES_TOLERANCE = 1e-18
"""Terms of a series about 1/4 below this are negligible."""
_MIN_STEP_RATIO = 0.45
"""A sample is late, and g linear, where a step before is shorter than this fraction of the new one."""


class MomentumObserver(NamedTuple):
    """State of one group of k equations that are sampled together."""

    momentum: np.ndarray
    """h at the last sample, shape (k,) [Nms for joints; Ns and Nms for a sensor]."""
    integrand: np.ndarray
    """g at the last three samples, the latest first, shape (3, k)."""
    residual: np.ndarray
    """Low-passed external part, shape (k,): s_j . w of contacts distal to each joint [Nm], or the wrench w
    [N, Nm]."""
    scalars: np.ndarray
    """Samples since the start, last two steps [s], variance of the residual over that of white noise in the
    measurement, covariance of the residual with the noise of the last three samples; shape (7,)."""


def empty_observer(size: int) -> MomentumObserver:
    """State before the first sample, for that many equations."""
    return MomentumObserver(np.zeros(size), np.zeros((3, size)), np.zeros(size), np.zeros(7))


def empty_observers(groups: int, size: int) -> MomentumObserver:
    """The same for several groups of as many equations each, sampled at their own times: with a leading axis;
    `group_of` returns one of them."""
    return MomentumObserver(
        np.zeros((groups, size)), np.zeros((groups, 3, size)), np.zeros((groups, size)), np.zeros((groups, 7))
    )


@inlined_kernel
def group_of(state: MomentumObserver, group: int) -> MomentumObserver:
    """One of the groups of `empty_observers`."""
    return MomentumObserver(
        state.momentum[group], state.integrand[group], state.residual[group], state.scalars[group]
    )


def noise_variance_ratio(bandwidth: float, dt: float) -> float:
    """Variance of the residual over that of white noise in the measurement, at constant sample time [s]."""
    state = empty_observer(0)
    for i in range(4 + math.ceil(20.0 / (2.0 * math.pi * bandwidth * dt))):
        start_step(state, dt if i else 0.0, bandwidth)
    return float(state.scalars[VARIANCE_RATIO])


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
def start_step(
    state: MomentumObserver, dt: float, bandwidth: float
) -> tuple[float, float, float, float, float, float]:
    """Start a step of dt [s] for all equations of a group and update its scalars; dt = 0 restarts the group.

    Returns:
        a, and K dt times the weights of g at the new sample and the three before it; and K [1/s]. `advance`
        takes them.
    """
    scalars = state.scalars
    K = 2.0 * math.pi * bandwidth
    if dt <= 0.0:
        scalars[:] = 0.0
        scalars[SAMPLES] = 1.0
        return 0.0, 0.0, 0.0, 0.0, 0.0, K
    k = K * dt
    a = math.exp(-k)
    m0, m1, m2, m3 = _moments(k)
    b0, b1, b2, b3 = m1, m0 - m1, 0.0, 0.0
    if (
        scalars[SAMPLES] >= 3.0
        and scalars[STEP] >= _MIN_STEP_RATIO * dt
        and scalars[STEP_BEFORE] >= _MIN_STEP_RATIO * dt
    ):
        # Newton's form of the cubic through the nodes 1, 0, -p, -q, in units of dt.
        p = scalars[STEP] / dt
        q = p + scalars[STEP_BEFORE] / dt
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
    ratio, c0, c1, c2 = scalars[VARIANCE_RATIO], scalars[4], scalars[5], scalars[6]
    # White noise n of the samples propagates as r1 = a r0 - b0 n1 - b1 n0 - ...
    scalars[VARIANCE_RATIO] = (
        a * a * ratio
        + b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3
        - 2.0 * a * (b1 * c0 + b2 * c1 + b3 * c2)
    )  # fmt: skip
    scalars[4], scalars[5], scalars[6] = -b0, a * c0 - b1, a * c1 - b2
    scalars[SAMPLES] += 1.0
    scalars[STEP_BEFORE] = scalars[STEP]
    scalars[STEP] = dt
    return a, b0, b1, b2, b3, K


@inlined_kernel
def in_step(state: MomentumObserver, other: MomentumObserver) -> bool:
    """Whether two groups have had the same steps, so that `start_step` gives the same for both."""
    same = True
    for i in range(7):
        same = same and state.scalars[i] == other.scalars[i]
    return same


@inlined_kernel
def advance(
    state: MomentumObserver,
    i: int,
    momentum: float,
    drift: float,
    step: tuple[float, float, float, float, float, float],
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
