"""Which link is touched: every link is a hypothesis with its fused wrench and its evidence (theory, section
3).

The hypothesis "link k is touched" says that the base sensor and the joints below the link see the contact
wrench w,

    base:   y_b = w + noise          joints:  r_j = s_j . w + noise  for j <= depth(k),   r_j = noise  beyond,

and that a wrist sensor sees it for links beyond the wrist only. Starting from the base measurement, or from a
broad prior where there is none, one scalar Kalman step per joint, going outward, gives all hypotheses in
turn. Any subset of sensors is the same code with steps left out.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.square import add_slope, add_square, mirror
from kinematics.core import dot6
from robots.arrays import copy
from robots.compiled import fused_kernel

BROAD = 1e3
"""Standard deviation of the wrench before any measurement, where there is no base sensor [N and Nm]."""

_LOG_2PI = math.log(2.0 * math.pi)


class Sensors(NamedTuple):
    """What sees which link, and how noisy the sensors are. Covariances are about the base origin, base
    axes."""

    depth: np.ndarray
    """Number of joints between the base and each link, rising, shape (links,), int64."""
    beyond_wrist: np.ndarray
    """1 for links on which the wrist sensor sees a contact, else 0, shape (links,), int64."""
    base_covariance: np.ndarray
    """Covariance of the base wrench, shape (6, 6)."""
    base_information: np.ndarray
    """Its inverse, shape (6, 6)."""
    torque_variance: np.ndarray
    """Variance of each joint torque's noise in one sample, shape (n,) [Nm^2]."""
    wrist_variance: np.ndarray
    """Variance of each force and each moment component of the wrist sensor about its origin, shape (2,) [N^2,
    Nm^2]."""


class Hypotheses(NamedTuple):
    """One row per link, filled by `isolate`."""

    wrench: np.ndarray
    """Fused contact wrench about the base origin, base axes, shape (links, 6) [N, Nm]."""
    covariance: np.ndarray
    """Its covariance, shape (links, 6, 6)."""
    information: np.ndarray
    """Inverse of `covariance`; summed up on the way, not inverted, shape (links, 6, 6)."""
    energy: np.ndarray
    """Half the squared residuals that remain at the fused wrench, in units of the noise, shape (links,)."""
    log_evidence: np.ndarray
    """Log likelihood of all measurements if this link is touched by any wrench at all, shape (links,)."""


def empty_hypotheses(links: int) -> Hypotheses:
    """Arrays for that many links."""
    return Hypotheses(
        wrench=np.empty((links, 6)),
        covariance=np.empty((links, 6, 6)),
        information=np.empty((links, 6, 6)),
        energy=np.empty(links),
        log_evidence=np.empty(links),
    )


@fused_kernel
def _observe(a, value, variance, w, P, L):  # type: ignore[no-untyped-def]
    """Kalman step for value = a . w + noise, in place; energy and variance of the innovation."""
    row = (a[0], a[1], a[2], a[3], a[4], a[5])
    g = (dot6(P[0], row), dot6(P[1], row), dot6(P[2], row), dot6(P[3], row), dot6(P[4], row), dot6(P[5], row))
    spread = variance + dot6(row, g)
    innovation = value - dot6(row, w)
    sharpness = 1.0 / spread
    add_slope(w, sharpness * innovation, g)
    add_square(P, -sharpness, g)
    mirror(P)
    add_square(L, 1.0 / variance, row)
    mirror(L)
    return 0.5 * innovation * innovation * sharpness, spread


@fused_kernel
def _observe_wrist(variance_f, variance_m, y, origin, w, P, L):  # type: ignore[no-untyped-def]
    """Six steps for a wrist sensor at `origin`: its force, and its moment about its own origin, where noise
    is isotropic. Energy of the innovations, and the product of their variances in units of the noise's."""
    energy = 0.0
    volume = 1.0
    ox, oy, oz = origin[0], origin[1], origin[2]
    mx, my, mz = y[3] - oy * y[2] + oz * y[1], y[4] - oz * y[0] + ox * y[2], y[5] - ox * y[1] + oy * y[0]
    rows = (
        ((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), y[0], variance_f),
        ((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), y[1], variance_f),
        ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0), y[2], variance_f),
        ((0.0, oz, -oy, 1.0, 0.0, 0.0), mx, variance_m),
        ((-oz, 0.0, ox, 0.0, 1.0, 0.0), my, variance_m),
        ((oy, -ox, 0.0, 0.0, 0.0, 1.0), mz, variance_m),
    )
    for row, value, variance in rows:
        cost, spread = _observe(row, value, variance, w, P, L)
        energy += cost
        volume *= spread / variance
    return energy, volume


@fused_kernel
def _null_wrist(variance_f, variance_m, y, origin):  # type: ignore[no-untyped-def]
    """Energy of a wrist reading if nothing touches beyond the wrist."""
    ox, oy, oz = origin[0], origin[1], origin[2]
    mx, my, mz = y[3] - oy * y[2] + oz * y[1], y[4] - oz * y[0] + ox * y[2], y[5] - ox * y[1] + oy * y[0]
    force = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    return 0.5 * (force / variance_f + (mx * mx + my * my + mz * mz) / variance_m)


@fused_kernel
def isolate(
    sensors: Sensors,
    screw: np.ndarray,
    base_wrench: np.ndarray,
    has_base: bool,
    torque: np.ndarray,
    seen_torque: np.ndarray,
    torque_variance: np.ndarray,
    has_torque: bool,
    wrist_wrench: np.ndarray,
    seen_wrist: np.ndarray,
    has_wrist: bool,
    wrist_origin: np.ndarray,
    scale: float,
    out: Hypotheses,
) -> None:
    """Fill `out` with one hypothesis per link.

    Args:
        sensors: What sees which link, and the noise.
        screw: Joint screws in the base frame, shape (n, 6).
        base_wrench: External wrench that the base sensor sees (the arm's own part taken off), shape (6,).
        has_base: Whether `base_wrench` was measured.
        torque: External part of the joint torques, as s_j . w: what contacts ask of the joint, shape (n,).
        seen_torque: The same for joints that see the contact; differs from `torque` where that was
            low-passed in other frames than the base wrench, see `contactsense.equations`, shape (n,).
        torque_variance: Variance of each `torque`, of whatever origin, shape (n,) [Nm^2].
        has_torque: Whether `torque` was measured.
        wrist_wrench: External wrench that the wrist sensor sees, about the base origin, base axes, shape
            (6,).
        seen_wrist: The same for links beyond the wrist, shape (6,).
        has_wrist: Whether `wrist_wrench` was measured.
        wrist_origin: Origin of the wrist sensor in the base frame [m], shape (3,).
        scale: Factor on the variances of the force/torque sensors: below one for filtered measurements.
        out: Filled row by row.
    """
    joints = torque.shape[0]
    links = sensors.depth.shape[0]
    w, P, L = out.wrench, out.covariance, out.information
    for i in range(6):
        w[0, i] = base_wrench[i] if has_base else 0.0
        for k in range(6):
            if has_base:
                P[0, i, k] = sensors.base_covariance[i, k] * scale
                L[0, i, k] = sensors.base_information[i, k] / scale
            else:
                P[0, i, k] = BROAD * BROAD if i == k else 0.0
                L[0, i, k] = 1.0 / (BROAD * BROAD) if i == k else 0.0
    seen = 0
    energy = 0.0
    # Product of the variances of all measurements but the base wrench, and their number.
    volume, count = 1.0, 0
    if has_torque:
        count += joints
        for j in range(joints):
            energy += 0.5 * torque[j] * torque[j] / torque_variance[j]
            volume *= torque_variance[j]
    wrist_seen = False
    null_wrist = 0.0
    force_variance = sensors.wrist_variance[0] * scale
    moment_variance = sensors.wrist_variance[1] * scale
    if has_wrist:
        count += 6
        null_wrist = _null_wrist(force_variance, moment_variance, wrist_wrench, wrist_origin)
        energy += null_wrist
        volume *= (force_variance * moment_variance) ** 3
    for link in range(links):
        if link > 0:
            copy(w[link - 1], w[link])
            for i in range(6):
                copy(P[link - 1, i], P[link, i])
                copy(L[link - 1, i], L[link, i])
        while seen < sensors.depth[link]:
            if has_torque:
                # Under this hypothesis the joint sees the contact: an innovation takes the place of what is
                # noise alone.
                variance = torque_variance[seen]
                cost, spread = _observe(screw[seen], seen_torque[seen], variance, w[link], P[link], L[link])
                energy += cost - 0.5 * torque[seen] * torque[seen] / variance
                volume *= spread / variance
            seen += 1
        if has_wrist and sensors.beyond_wrist[link] and not wrist_seen:
            wrist_seen = True
            cost, wider = _observe_wrist(
                force_variance, moment_variance, seen_wrist, wrist_origin, w[link], P[link], L[link]
            )
            energy += cost - null_wrist
            volume *= wider
        out.energy[link] = energy
        out.log_evidence[link] = -energy - 0.5 * (math.log(volume) + count * _LOG_2PI)
