"""Link hypotheses: for every link the fused contact wrench and its evidence.

Under the hypothesis "contact on link k", the base sensor measures the contact wrench w, and so does every
row of a sensor that sees the link:

    base:  y_b = w + noise          rows:  y_i = a_i . w + noise  for first_link_i <= k,  y_i = noise  else.

A joint torque is one row, its screw, seen from the link that it moves on; a force/torque sensor within the
arm is six. Starting from the base measurement, or from a broad prior without one, one scalar Kalman step per
row, going outward, gives all hypotheses in turn. For a subset of the sensors the other rows are omitted.
"""

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from contactsense.kinematics.logarithm import logarithm
from contactsense.kinematics.spatial import Six, dot6
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel

PRIOR_STD = 1e3
"""Standard deviation of the wrench before any measurement, without a base sensor [N and Nm]."""

_LOG_2PI = math.log(2.0 * math.pi)
_LARGEST, _LARGEST_INVERSE = 1e200, 1e-200
"""Products beyond these are replaced by their logarithm."""

Symmetric: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float, float,
    float, float, float, float, float, float,
]  # fmt: skip
"""Upper triangle of a symmetric 6x6 matrix, row by row."""


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


@inlined_fused_kernel
def _times(A: Symmetric, x: Six) -> Six:
    """A x."""
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2] + A[3] * x[3] + A[4] * x[4] + A[5] * x[5],
        A[1] * x[0] + A[6] * x[1] + A[7] * x[2] + A[8] * x[3] + A[9] * x[4] + A[10] * x[5],
        A[2] * x[0] + A[7] * x[1] + A[11] * x[2] + A[12] * x[3] + A[13] * x[4] + A[14] * x[5],
        A[3] * x[0] + A[8] * x[1] + A[12] * x[2] + A[15] * x[3] + A[16] * x[4] + A[17] * x[5],
        A[4] * x[0] + A[9] * x[1] + A[13] * x[2] + A[16] * x[3] + A[18] * x[4] + A[19] * x[5],
        A[5] * x[0] + A[10] * x[1] + A[14] * x[2] + A[17] * x[3] + A[19] * x[4] + A[20] * x[5],
    )


@inlined_fused_kernel
def _plus_outer_product(A: Symmetric, weight: float, x: Six) -> Symmetric:
    """A + weight x x^T."""
    y0, y1, y2, y3, y4, y5 = (
        weight * x[0], weight * x[1], weight * x[2], weight * x[3], weight * x[4], weight * x[5],
    )  # fmt: skip
    return (
        A[0] + y0 * x[0],
        A[1] + y0 * x[1],
        A[2] + y0 * x[2],
        A[3] + y0 * x[3],
        A[4] + y0 * x[4],
        A[5] + y0 * x[5],
        A[6] + y1 * x[1],
        A[7] + y1 * x[2],
        A[8] + y1 * x[3],
        A[9] + y1 * x[4],
        A[10] + y1 * x[5],
        A[11] + y2 * x[2],
        A[12] + y2 * x[3],
        A[13] + y2 * x[4],
        A[14] + y2 * x[5],
        A[15] + y3 * x[3],
        A[16] + y3 * x[4],
        A[17] + y3 * x[5],
        A[18] + y4 * x[4],
        A[19] + y4 * x[5],
        A[20] + y5 * x[5],
    )


@inlined_fused_kernel
def _upper_triangle(A: np.ndarray, factor: float) -> Symmetric:
    """The upper triangle of `factor` times a symmetric matrix, row by row."""
    return (
        factor * A[0, 0], factor * A[0, 1], factor * A[0, 2], factor * A[0, 3], factor * A[0, 4],
        factor * A[0, 5], factor * A[1, 1], factor * A[1, 2], factor * A[1, 3], factor * A[1, 4],
        factor * A[1, 5], factor * A[2, 2], factor * A[2, 3], factor * A[2, 4], factor * A[2, 5],
        factor * A[3, 3], factor * A[3, 4], factor * A[3, 5], factor * A[4, 4], factor * A[4, 5],
        factor * A[5, 5],
    )  # fmt: skip


@inlined_fused_kernel
def _multiple_of_identity(value: float) -> Symmetric:
    return (
        value, 0.0, 0.0, 0.0, 0.0, 0.0, value, 0.0, 0.0, 0.0, 0.0, value, 0.0, 0.0, 0.0, value, 0.0, 0.0,
        value, 0.0, value,
    )  # fmt: skip


@inlined_fused_kernel
def _store(A: Symmetric, out: np.ndarray) -> None:
    """Write both triangles of a symmetric matrix."""
    out[0, 0], out[0, 1], out[0, 2], out[0, 3], out[0, 4], out[0, 5] = A[0], A[1], A[2], A[3], A[4], A[5]
    out[1, 0], out[1, 1], out[1, 2], out[1, 3], out[1, 4], out[1, 5] = A[1], A[6], A[7], A[8], A[9], A[10]
    out[2, 0], out[2, 1], out[2, 2], out[2, 3], out[2, 4], out[2, 5] = A[2], A[7], A[11], A[12], A[13], A[14]
    out[3, 0], out[3, 1], out[3, 2], out[3, 3], out[3, 4], out[3, 5] = A[3], A[8], A[12], A[15], A[16], A[17]
    out[4, 0], out[4, 1], out[4, 2], out[4, 3], out[4, 4], out[4, 5] = A[4], A[9], A[13], A[16], A[18], A[19]
    out[5, 0], out[5, 1], out[5, 2], out[5, 3], out[5, 4], out[5, 5] = A[5], A[10], A[14], A[17], A[19], A[20]


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
    # Tuples, which the compiler keeps in registers: a step would wait for what the last one has stored.
    w = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    P, L = _multiple_of_identity(PRIOR_STD * PRIOR_STD), _multiple_of_identity(PRIOR_STD**-2.0)
    if has_base:
        w = (
            base_wrench[0], base_wrench[1], base_wrench[2], base_wrench[3], base_wrench[4], base_wrench[5],
        )  # fmt: skip
        P = _upper_triangle(base_covariance, variance_ratio)
        L = _upper_triangle(base_information, 1.0 / variance_ratio)
    energy = 0.0
    # Product of the variances of all rows, as exp(log_volume) * volume: one logarithm for many factors.
    log_volume, volume = 0.0, 1.0
    for i in range(count):
        energy += 0.5 * rows.value[i] * rows.value[i] / rows.variance[i]
        volume *= rows.variance[i]
        log_volume, volume = _within_range(log_volume, volume)
    for link in range(out.energy.shape[0]):
        for i in range(count):
            if rows.first_link[i] != link:
                continue
            # Under this hypothesis the sensor carries the contact: its innovation replaces the energy of
            # noise alone.
            variance = rows.variance[i]
            a = rows.screw[i]
            row = (a[0], a[1], a[2], a[3], a[4], a[5])
            # One Kalman step.
            covariance = _times(P, row)
            innovation_variance = variance + dot6(row, covariance)
            innovation, precision = rows.proximal_value[i] - dot6(row, w), 1.0 / innovation_variance
            gain = precision * innovation
            w = (
                w[0] + gain * covariance[0],
                w[1] + gain * covariance[1],
                w[2] + gain * covariance[2],
                w[3] + gain * covariance[3],
                w[4] + gain * covariance[4],
                w[5] + gain * covariance[5],
            )
            P = _plus_outer_product(P, -precision, covariance)
            L = _plus_outer_product(L, 1.0 / variance, row)
            energy += 0.5 * innovation * gain - 0.5 * rows.value[i] * rows.value[i] / variance
            volume *= innovation_variance / variance
            log_volume, volume = _within_range(log_volume, volume)
        for i in range(6):
            out.wrench[link, i] = w[i]
        _store(P, out.covariance[link])
        _store(L, out.information[link])
        out.energy[link] = energy
        out.log_evidence[link] = -energy - 0.5 * (log_volume + logarithm(volume) + count * _LOG_2PI)


@fused_kernel
def _within_range(log_volume: float, volume: float) -> tuple[float, float]:
    """The same product with a second factor that can be multiplied further."""
    if _LARGEST_INVERSE < volume < _LARGEST:
        return log_volume, volume
    return log_volume + math.log(volume), 1.0
