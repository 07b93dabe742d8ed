"""Link hypotheses: for every link the fused contact wrench and its evidence (theory, section 3).

Under the hypothesis "contact on link k", the base sensor and the joints proximal to the link measure the
contact wrench w,

    base:   y_b = w + noise          joints:  r_j = s_j . w + noise  for j <= depth(k),   r_j = noise  beyond,

and a wrist sensor measures it for links distal to the wrist only. Starting from the base measurement, or from
a broad prior without one, one scalar Kalman step per joint, going outward, gives all hypotheses in turn. For
a subset of the sensors the other steps are omitted.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.linalg.outer_product import add_outer_product, add_scaled_vector, symmetrize
from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import fused_kernel

PRIOR_STD = 1e3
"""Standard deviation of the wrench before any measurement, without a base sensor [N and Nm]."""

_LOG_2PI = math.log(2.0 * math.pi)


class SensorModel(NamedTuple):
    """Which sensor measures a contact on which link, and the noise. Covariances are about the base origin,
    base axes."""

    depth: np.ndarray
    """Number of joints between the base and each link, increasing, shape (links,), int64."""
    beyond_wrist: np.ndarray
    """1 for links on which a contact is measured by the wrist sensor, else 0, shape (links,), int64."""
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
    """Inverse of `covariance`; accumulated, not inverted, shape (links, 6, 6)."""
    energy: np.ndarray
    """Half the squared residuals at the fused wrench, in units of the noise, shape (links,)."""
    log_evidence: np.ndarray
    """Log likelihood of all measurements under a contact on this link with any wrench, shape (links,)."""


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
def _kalman_step(a, value, variance, w, P, L):  # type: ignore[no-untyped-def]
    """Kalman step for value = a . w + noise, in place; energy and variance of the innovation."""
    row = (a[0], a[1], a[2], a[3], a[4], a[5])
    cross_covariance = (
        dot6(P[0], row),
        dot6(P[1], row),
        dot6(P[2], row),
        dot6(P[3], row),
        dot6(P[4], row),
        dot6(P[5], row),
    )
    innovation_variance = variance + dot6(row, cross_covariance)
    innovation = value - dot6(row, w)
    precision = 1.0 / innovation_variance
    add_scaled_vector(w, precision * innovation, cross_covariance)
    add_outer_product(P, -precision, cross_covariance)
    symmetrize(P)
    add_outer_product(L, 1.0 / variance, row)
    symmetrize(L)
    return 0.5 * innovation * innovation * precision, innovation_variance


@fused_kernel
def _kalman_steps_wrist(variance_f, variance_m, y, origin, w, P, L):  # type: ignore[no-untyped-def]
    """Six Kalman steps for a wrist sensor at `origin`: its force, and its moment about its own origin, where
    noise is isotropic. Returns the energy of the innovations, and the product of their variances over those
    of the noise."""
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
        energy_step, innovation_variance = _kalman_step(row, value, variance, w, P, L)
        energy += energy_step
        volume *= innovation_variance / variance
    return energy, volume


@fused_kernel
def _wrist_energy_without_contact(variance_f, variance_m, y, origin):  # type: ignore[no-untyped-def]
    """Energy of a wrist reading without a contact distal to the wrist."""
    ox, oy, oz = origin[0], origin[1], origin[2]
    mx, my, mz = y[3] - oy * y[2] + oz * y[1], y[4] - oz * y[0] + ox * y[2], y[5] - ox * y[1] + oy * y[0]
    force = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    return 0.5 * (force / variance_f + (mx * mx + my * my + mz * mz) / variance_m)


@fused_kernel
def isolate(
    sensors: SensorModel,
    screw: np.ndarray,
    base_wrench: np.ndarray,
    has_base: bool,
    torque: np.ndarray,
    proximal_torque: np.ndarray,
    torque_variance: np.ndarray,
    has_torque: bool,
    wrist_wrench: np.ndarray,
    proximal_wrist_wrench: np.ndarray,
    has_wrist: bool,
    wrist_origin: np.ndarray,
    variance_ratio: float,
    out: Hypotheses,
) -> None:
    """Fill `out` with one hypothesis per link.

    Args:
        sensors: Which sensor measures which link, and the noise.
        screw: Joint screws in the base frame, shape (n, 6).
        base_wrench: External wrench on the base sensor, shape (6,).
        has_base: Whether `base_wrench` was measured.
        torque: External part of the joint torques as s_j . w, shape (n,).
        proximal_torque: The same for joints proximal to the contact; differs from `torque` where the base
            wrench was low-passed in other frames, see `contactsense.residuals.equations_of_motion`, shape
            (n,).
        torque_variance: Variance of each `torque`, from all sources, shape (n,) [Nm^2].
        has_torque: Whether `torque` was measured.
        wrist_wrench: External wrench on the wrist sensor, about the base origin, base axes, shape (6,).
        proximal_wrist_wrench: The same for contacts distal to the wrist, shape (6,).
        has_wrist: Whether `wrist_wrench` was measured.
        wrist_origin: Origin of the wrist sensor in the base frame [m], shape (3,).
        variance_ratio: Factor on the variances of the force/torque sensors' noise: below one for filtered
            measurements.
        out: Filled row by row.
    """
    joints = torque.shape[0]
    links = sensors.depth.shape[0]
    w, P, L = out.wrench, out.covariance, out.information
    for i in range(6):
        w[0, i] = base_wrench[i] if has_base else 0.0
        for k in range(6):
            if has_base:
                P[0, i, k] = sensors.base_covariance[i, k] * variance_ratio
                L[0, i, k] = sensors.base_information[i, k] / variance_ratio
            else:
                P[0, i, k] = PRIOR_STD * PRIOR_STD if i == k else 0.0
                L[0, i, k] = 1.0 / (PRIOR_STD * PRIOR_STD) if i == k else 0.0
    joint = 0
    energy = 0.0
    # Product of the variances of all measurements but the base wrench, and their number.
    volume, count = 1.0, 0
    if has_torque:
        count += joints
        for j in range(joints):
            energy += 0.5 * torque[j] * torque[j] / torque_variance[j]
            volume *= torque_variance[j]
    includes_wrist = False
    wrist_energy = 0.0
    force_variance = sensors.wrist_variance[0] * variance_ratio
    moment_variance = sensors.wrist_variance[1] * variance_ratio
    if has_wrist:
        count += 6
        wrist_energy = _wrist_energy_without_contact(
            force_variance, moment_variance, wrist_wrench, wrist_origin
        )
        energy += wrist_energy
        volume *= (force_variance * moment_variance) ** 3
    for link in range(links):
        if link > 0:
            copy(w[link - 1], w[link])
            for i in range(6):
                copy(P[link - 1, i], P[link, i])
                copy(L[link - 1, i], L[link, i])
        while joint < sensors.depth[link]:
            if has_torque:
                # Under this hypothesis the joint carries the contact: its innovation replaces the energy
                # of noise alone.
                variance = torque_variance[joint]
                energy_step, innovation_variance = _kalman_step(
                    screw[joint], proximal_torque[joint], variance, w[link], P[link], L[link]
                )
                energy += energy_step - 0.5 * torque[joint] * torque[joint] / variance
                volume *= innovation_variance / variance
            joint += 1
        if has_wrist and sensors.beyond_wrist[link] and not includes_wrist:
            includes_wrist = True
            energy_step, variance_product = _kalman_steps_wrist(
                force_variance,
                moment_variance,
                proximal_wrist_wrench,
                wrist_origin,
                w[link],
                P[link],
                L[link],
            )
            energy += energy_step - wrist_energy
            volume *= variance_product
        out.energy[link] = energy
        out.log_evidence[link] = -energy - 0.5 * (math.log(volume) + count * _LOG_2PI)
