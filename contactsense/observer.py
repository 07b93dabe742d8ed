"""Momentum observer: external joint torques and external base wrench without accelerations (theory, section
2).

Joints and sensors obey equations of one shape, dh/dt = drift + external, with h = s_j . H_j for a joint and h
= H_0 for the base. One first-order observer serves all, with one gain K = 2 pi bandwidth:

    dr/dt = K (external - r),   solved over one step, with a = exp(-K dt), as

    r1 = a r0 + K (h1 - a h0) - K integral( exp(-K (t1 - t)) g(t) dt ),    g = K h + drift.

That is exact but for the integral, for which g is taken as the cubic through its last four samples, whatever
their distances. Where a sample is late (the steps before it are much shorter than its own) a cubic would
blow noise up: there g is taken as a straight line. Nothing depends on a steady rate, every dt is stable.

How much of the noise of single samples comes through depends on the steps too. `Observer.clock` carries it
along, so that the covariance fits jittering and gappy streams as well.
"""

import math
from typing import NamedTuple

import numpy as np

from robots.compiled import inlined_kernel, kernel

SAMPLES, STEP, STEP_BEFORE, GAIN = 0, 1, 2, 3
"""Places in `Observer.clock`."""
_TINY = 1e-18
"""Terms of a series about 1/4 that are smaller change nothing."""
_LATE = 0.45
"""Where a step before is shorter than this share of the new one, the new one is late: no cubic."""


class Observer(NamedTuple):
    """State of one group of k equations that are sampled together."""

    momentum: np.ndarray
    """h at the last sample, shape (k,) [Nms for joints; Ns and Nms for a sensor]."""
    past: np.ndarray
    """g at the last three samples, the latest first, shape (3, k)."""
    residual: np.ndarray
    """Low-passed external part, shape (k,): s_j . w of contacts beyond each joint [Nm], or the wrench w [N,
    Nm]."""
    clock: np.ndarray
    """Samples since the start, last two steps [s], variance of the residual over that of white noise in the
    measurement, covariance of the residual with the noise of the last three samples; shape (7,)."""


def empty_observer(size: int) -> Observer:
    """State before the first sample, for that many equations."""
    return Observer(np.zeros(size), np.zeros((3, size)), np.zeros(size), np.zeros(7))


def noise_gain(bandwidth: float, dt: float) -> float:
    """Variance of the residual over that of white noise in the measurement, at a steady sample time dt
    [s]."""
    state = empty_observer(0)
    for i in range(4 + math.ceil(20.0 / (2.0 * math.pi * bandwidth * dt))):
        begin(state, dt if i else 0.0, bandwidth)
    return float(state.clock[GAIN])


@kernel
def _moments(k: float) -> tuple[float, float, float, float]:
    """Integrals of s^n exp(-k (1 - s)) over s from 0 to 1, n = 0..3."""
    if k > 2.0:
        m0 = -math.expm1(-k) / k
        m1 = (1.0 - m0) / k
        m2 = (1.0 - 2.0 * m1) / k
        return m0, m1, m2, (1.0 - 3.0 * m2) / k
    # The recursion above loses digits as k -> 0; downward from a series it does not.
    term, m3 = 0.25, 0.25
    for i in range(5, 26):
        term *= -k / i
        m3 += term
        if abs(term) < _TINY:
            break
    m2 = (1.0 - k * m3) / 3.0
    m1 = (1.0 - k * m2) / 2.0
    return 1.0 - k * m1, m1, m2, m3


@kernel
def begin(state: Observer, dt: float, bandwidth: float) -> tuple[float, float, float, float, float, float]:
    """Start a step of dt [s] for all equations of a group: advance its clock; dt = 0 starts the group anew.

    Returns:
        a, and K dt times the weights of g at the new sample and the three before it; and K [1/s]. `advance`
        takes them.
    """
    clock = state.clock
    K = 2.0 * math.pi * bandwidth
    if dt <= 0.0:
        clock[:] = 0.0
        clock[SAMPLES] = 1.0
        return 0.0, 0.0, 0.0, 0.0, 0.0, K
    k = K * dt
    a = math.exp(-k)
    m0, m1, m2, m3 = _moments(k)
    b0, b1, b2, b3 = m1, m0 - m1, 0.0, 0.0
    if clock[SAMPLES] >= 3.0 and clock[STEP] >= _LATE * dt and clock[STEP_BEFORE] >= _LATE * dt:
        # Newton's form of the cubic through the nodes 1, 0, -p, -q, in units of dt.
        p = clock[STEP] / dt
        q = p + clock[STEP_BEFORE] / dt
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
    gain, c0, c1, c2 = clock[GAIN], clock[4], clock[5], clock[6]
    # White noise n of the samples goes through: r1 = a r0 - b0 n1 - b1 n0 - ...
    clock[GAIN] = (
        a * a * gain
        + b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3
        - 2.0 * a * (b1 * c0 + b2 * c1 + b3 * c2)
    )  # fmt: skip
    clock[4], clock[5], clock[6] = -b0, a * c0 - b1, a * c1 - b2
    clock[SAMPLES] += 1.0
    clock[STEP_BEFORE] = clock[STEP]
    clock[STEP] = dt
    return a, b0, b1, b2, b3, K


@inlined_kernel
def advance(
    state: Observer,
    i: int,
    momentum: float,
    drift: float,
    step: tuple[float, float, float, float, float, float],
) -> None:
    """Equation i's step: `momentum` is h, `drift` the known part of dh/dt at the new sample; `step` is what
    `begin` returned."""
    a, b0, b1, b2, b3, K = step
    g = K * momentum + drift
    past = state.past
    if b0 > 0.0:
        state.residual[i] = (
            a * state.residual[i]
            + K * (momentum - a * state.momentum[i])
            - (b0 * g + b1 * past[0, i] + b2 * past[1, i] + b3 * past[2, i])
        )
    else:
        state.residual[i] = 0.0
    past[2, i], past[1, i], past[0, i] = past[1, i], past[0, i], g
    state.momentum[i] = momentum
