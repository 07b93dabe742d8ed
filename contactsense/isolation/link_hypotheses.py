"""Link hypotheses: for every link the fused contact wrench and its evidence (theory, section 3).

Under the hypothesis "contact on link k", the base sensor measures the contact wrench w, and so does every
row of a sensor that sees the link:

    base:  y_b = w + noise          rows:  y_i = a_i . w + noise  for first_link_i <= k,  y_i = noise  else.

A joint torque is one row, its screw, seen from the link that it moves on; a force/torque sensor within the
arm is six. Starting from the base measurement, or from a broad prior without one, one scalar Kalman step per
row, going outward, gives all hypotheses in turn. For a subset of the sensors the other rows are omitted.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.spatial import Six, dot6
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import fused_kernel

PRIOR_STD = 1e3
"""Standard deviation of the wrench before any measurement, without a base sensor [N and Nm]."""

_LOG_2PI = math.log(2.0 * math.pi)
_LARGEST, _LARGEST_INVERSE = 1e200, 1e-200
"""Products beyond these are replaced by their logarithm."""


class SensorModel(NamedTuple):
    """Which sensor measures a contact on which link, and the noise. Covariances are about the base origin,
    base axes."""

    depth: Annotated[Integers, "links"]
    """Number of joints between the base and each link, increasing."""
    first_link: Annotated[Integers, "link_sensors"]
    """First link on which each of the S link sensors, force/torque sensors within the arm, measures a
    contact, as it does on all further ones."""
    base_covariance: Annotated[Floats, "6, 6"]
    """Covariance of the base wrench."""
    base_information: Annotated[Floats, "6, 6"]
    """Its inverse."""
    torque_variance: Annotated[Floats, "joints"]
    """Variance of each joint torque's noise in one sample [Nm^2]."""
    link_variance: Annotated[Floats, "link_sensors, 2"]
    """Variance of each force and each moment component of the link sensors about their own origin [N^2,
    Nm^2]."""


class SensorRows(NamedTuple):
    """Scalar measurements other than the base wrench: `screw` . w + noise for a contact wrench w about the
    base origin, base axes, on links that the sensor sees, else noise alone. M is the most that there can
    be."""

    screw: Annotated[Floats, "rows, 6"]
    value: Annotated[Floats, "rows"]
    """The measurement."""
    proximal_value: Annotated[Floats, "rows"]
    """The same for contacts that the sensor sees; differs from `value` where the base wrench was low-passed
    in other frames, see `contactsense.residuals.equations_of_motion`."""
    variance: Annotated[Floats, "rows"]
    """Variance of its noise, from all sources."""
    first_link: Annotated[Integers, "rows"]
    """The sensor sees this link and all further ones."""


class Hypotheses(NamedTuple):
    """One row per link, filled by `isolate`."""

    wrench: Annotated[Floats, "links, 6"]
    """Fused contact wrench about the base origin, base axes [N, Nm]."""
    covariance: Annotated[Floats, "links, 6, 6"]
    """Its covariance."""
    information: Annotated[Floats, "links, 6, 6"]
    """Inverse of `covariance`; accumulated, not inverted."""
    energy: Annotated[Floats, "links"]
    """Half the squared residuals at the fused wrench, in units of the noise."""
    log_evidence: Annotated[Floats, "links"]
    """Log likelihood of all measurements under a contact on this link with any wrench."""


@fused_kernel
def _kalman_step(
    a: np.ndarray, value: float, variance: float, out: Hypotheses, before: int, link: int
) -> tuple[float, float]:
    """Kalman step for value = a . w + noise, from the hypothesis of link `before` to that of `link`, maybe
    the same; energy and variance of the innovation."""
    P, L, Q, M = out.covariance[before], out.information[before], out.covariance[link], out.information[link]
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
    innovation = value - dot6(row, out.wrench[before])
    precision = 1.0 / innovation_variance
    gain = precision * innovation
    for i in range(6):
        out.wrench[link, i] = out.wrench[before, i] + gain * cross_covariance[i]
    _add_outer_product(P, -precision, cross_covariance, Q)
    _add_outer_product(L, 1.0 / variance, row, M)
    return 0.5 * innovation * innovation * precision, innovation_variance


@fused_kernel
def _add_outer_product(A: np.ndarray, weight: float, x: Six, out: np.ndarray) -> None:
    """out = A + weight x x^T for a symmetric A, which may be `out`."""
    for i in range(6):
        scaled = weight * x[i]
        for k in range(i, 6):
            value = A[i, k] + scaled * x[k]
            out[i, k] = value
            out[k, i] = value


@fused_kernel
def isolate(
    base_covariance: np.ndarray,
    base_information: np.ndarray,
    base_wrench: np.ndarray,
    has_base: bool,
    rows: SensorRows,
    count: int,
    variance_ratio: float,
    out: Hypotheses,
) -> None:
    """Fill `out` with one hypothesis per link.

    Args:
        base_covariance, base_information: Of the base wrench, divided by `variance_ratio`, and its inverse,
            shape (6, 6).
        base_wrench: External wrench on the base sensor, shape (6,).
        has_base: Whether `base_wrench` was measured.
        rows: The other measurements.
        count: Number of rows that were measured, the first ones.
        variance_ratio: Factor on the covariance of the base wrench: below one for filtered measurements.
        out: Filled link by link.
    """
    w, P, L = out.wrench, out.covariance, out.information
    for i in range(6):
        w[0, i] = base_wrench[i] if has_base else 0.0
        for k in range(6):
            if has_base:
                P[0, i, k] = base_covariance[i, k] * variance_ratio
                L[0, i, k] = base_information[i, k] / variance_ratio
            else:
                P[0, i, k] = PRIOR_STD * PRIOR_STD if i == k else 0.0
                L[0, i, k] = 1.0 / (PRIOR_STD * PRIOR_STD) if i == k else 0.0
    energy = 0.0
    # Product of the variances of all rows, as exp(log_volume) * volume: one logarithm for many factors.
    log_volume, volume = 0.0, 1.0
    for i in range(count):
        energy += 0.5 * rows.value[i] * rows.value[i] / rows.variance[i]
        volume *= rows.variance[i]
        log_volume, volume = _within_range(log_volume, volume)
    for link in range(w.shape[0]):
        before = max(link - 1, 0)
        for i in range(count):
            if rows.first_link[i] != link:
                continue
            # Under this hypothesis the sensor carries the contact: its innovation replaces the energy of
            # noise alone.
            variance = rows.variance[i]
            energy_step, innovation_variance = _kalman_step(
                rows.screw[i], rows.proximal_value[i], variance, out, before, link
            )
            before = link
            energy += energy_step - 0.5 * rows.value[i] * rows.value[i] / variance
            volume *= innovation_variance / variance
            log_volume, volume = _within_range(log_volume, volume)
        if before != link:
            # No sensor of its own.
            copy(w[before], w[link])
            for i in range(6):
                copy(P[before, i], P[link, i])
                copy(L[before, i], L[link, i])
        out.energy[link] = energy
        out.log_evidence[link] = -energy - 0.5 * (log_volume + math.log(volume) + count * _LOG_2PI)


@fused_kernel
def _within_range(log_volume: float, volume: float) -> tuple[float, float]:
    """The same product with a second factor that can be multiplied further."""
    if _LARGEST_INVERSE < volume < _LARGEST:
        return log_volume, volume
    return log_volume + math.log(volume), 1.0
