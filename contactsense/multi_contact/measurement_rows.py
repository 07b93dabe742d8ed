"""The measurement as whitened rows: the linear map from a wrench on each link to the sensor values.

The observers low-pass filter the measurement with the time constant `lag`. A contact that is fixed on
link k has a wrench w that moves with the link's twist V: dw/dt = V x* w. Its filtered value in base axes
is (1 + lag V x*)^-1 w. For the torque s_j . w, whose screw moves with link j, it is
s_j . (1 + lag (V - V_j) x*)^-1 w. Each link therefore has its own rows, and contacts on different links
of a moving arm are distinguished by their lag.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.isolation.link_hypotheses import SensorModel
from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import dot6
from contactsense.multi_contact.memory.buffers import Measurement, MeasurementRows
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.sensors.usable_sensors import Usable


class Variances(NamedTuple):
    """Variances of the measurement."""

    base_information: np.ndarray
    """Inverse covariance of the base wrench times `base_factor`, shape (6, 6)."""
    base_factor: float
    torque: np.ndarray
    """Variance of each torque, shape (n,) [Nm^2]."""
    link_row: np.ndarray
    """Combinations of the components of the link sensors' wrenches whose errors are uncorrelated, base axes,
    about the base origin, shape (S, 6, 6)."""
    link: np.ndarray
    """Their variances, shape (S, 6)."""


@fused_kernel
def _twist_cross(a: np.ndarray, twist: np.ndarray, sensor_twist: np.ndarray, out: np.ndarray) -> None:
    """Row c with c . w = a . (V x* w) for all w, V = twist - sensor_twist. Six floats each."""
    vx, vy, vz = twist[0] - sensor_twist[0], twist[1] - sensor_twist[1], twist[2] - sensor_twist[2]
    x, y, z = twist[3] - sensor_twist[3], twist[4] - sensor_twist[4], twist[5] - sensor_twist[5]
    out[0] = a[1] * z - a[2] * y + a[4] * vz - a[5] * vy
    out[1] = a[2] * x - a[0] * z + a[5] * vx - a[3] * vz
    out[2] = a[0] * y - a[1] * x + a[3] * vy - a[4] * vx
    out[3] = a[4] * z - a[5] * y
    out[4] = a[5] * x - a[3] * z
    out[5] = a[3] * y - a[4] * x


@fused_kernel
def _lagged_row(
    row: np.ndarray,
    twist: np.ndarray,
    sensor_twist: np.ndarray,
    lag: float,
    scratch: np.ndarray,
    out: np.ndarray,
) -> None:
    """Row of a link that moves with `twist`, for a sensor that moves with `sensor_twist`.

    row (1 + lag V x*)^-1, to second order in the lag.
    """
    copy(row, out)
    for _ in range(2):
        _twist_cross(out, twist, sensor_twist, scratch)
        for i in range(6):
            out[i] = row[i] - lag * scratch[i]


@fused_kernel
def fill_measurement_rows(
    sensors: SensorModel,
    motion: Motion,
    parts: tuple[np.ndarray, np.ndarray, np.ndarray],
    variances: Variances,
    present: Usable,
    lag: float,
    rows: MeasurementRows,
) -> int:
    """Fill `rows` with the whitened external wrenches and torques; returns the number of rows.

    Args:
        sensors: Which sensor measures which link.
        motion: Poses and twists.
        parts: External base wrench (6,), joint torques as s_j . w (n,) and wrenches on the link sensors (S,
            6), low-pass filtered in base axes.
        variances: Of `parts`.
        present: Which sensors have measured.
        lag: Time constant of the low-pass filter [s]; 0 without one.
        rows: Filled.
    """
    rows.seen[:] = 0.0
    rows.matrix[:] = 0.0
    m = 0
    if present[0]:
        m = _fill_base_rows(sensors, motion, parts[0], variances, lag, rows)
    if present[1]:
        m = _fill_torque_rows(sensors, motion, parts[1], variances.torque, lag, m, rows)
    for s in range(variances.link.shape[0]):
        if present[2] >> s & 1:
            m = _fill_link_sensor_rows(sensors, motion, s, parts[2][s], variances, lag, m, rows)
    return m


@fused_kernel
def _fill_base_rows(
    sensors: SensorModel,
    motion: Motion,
    wrench: np.ndarray,
    variances: Variances,
    lag: float,
    rows: MeasurementRows,
) -> int:
    """Fill the first rows with the external base wrench; returns the number of rows. Arguments as for
    `fill_measurement_rows`."""
    y, U = rows.value, rows.factor
    # Upper factor U of the information matrix U^T U: U times the noise has unit variance.
    for i in range(6):
        for k in range(6):
            U[i, k] = 0.0
        for k in range(i, 6):
            x = variances.base_information[i, k] / variances.base_factor
            for r in range(i):
                x -= U[r, i] * U[r, k]
            U[i, k] = math.sqrt(x) if k == i else x / U[i, i]
    for i in range(6):
        y[i] = 0.0
        for k in range(i, 6):
            y[i] += U[i, k] * wrench[k]
        for link in range(rows.seen.shape[0]):
            _fill_row(sensors, motion, U[i], motion.twist[0], link, lag, i, rows)
    return 6


@fused_kernel
def _fill_torque_rows(
    sensors: SensorModel,
    motion: Motion,
    torque: np.ndarray,
    variance: np.ndarray,
    lag: float,
    m: int,
    rows: MeasurementRows,
) -> int:
    """Fill the rows from m on with the joint torques; returns the number of rows. Arguments as for
    `fill_measurement_rows`."""
    y, row = rows.value, rows.row
    for j in range(variance.shape[0]):
        inverse_deviation = 1.0 / math.sqrt(variance[j])
        for k in range(6):
            row[k] = motion.screw[j, k] * inverse_deviation
        y[m] = torque[j] * inverse_deviation
        for link in range(rows.seen.shape[0]):
            if sensors.depth[link] > j:
                _fill_row(sensors, motion, row, motion.twist[j], link, lag, m, rows)
        m += 1
    return m


@fused_kernel
def _fill_link_sensor_rows(
    sensors: SensorModel,
    motion: Motion,
    s: int,
    wrench: np.ndarray,
    variances: Variances,
    lag: float,
    m: int,
    rows: MeasurementRows,
) -> int:
    """Fill the rows from m on with the wrench on link sensor s; returns the number of rows. Arguments as for
    `fill_measurement_rows`."""
    y, row = rows.value, rows.row
    for i in range(6):
        inverse_deviation = 1.0 / math.sqrt(variances.link[s, i])
        for k in range(6):
            row[k] = variances.link_row[s, i, k] * inverse_deviation
        y[m] = dot6(row, wrench)
        for link in range(rows.seen.shape[0]):
            if link >= sensors.first_link[s]:
                _fill_row(sensors, motion, row, motion.twist[0], link, lag, m, rows)
        m += 1
    return m


@fused_kernel
def _fill_row(
    sensors: SensorModel,
    motion: Motion,
    row: np.ndarray,
    sensor_twist: np.ndarray,
    link: int,
    lag: float,
    m: int,
    rows: MeasurementRows,
) -> None:
    """Fill row m for contacts on a link, of a sensor that moves with `sensor_twist`; `row`: without the lag,
    shape (6,). Other arguments as for `fill_measurement_rows`."""
    rows.seen[link, m] = 1.0
    twist = motion.twist[sensors.depth[link]]
    _lagged_row(row, twist, sensor_twist, lag, rows.transformed, rows.matrix[link, m])


@fused_kernel
def rank_of(measurement: Measurement, links: np.ndarray, count: int, scratch: np.ndarray) -> int:
    """Rank of the map from the wrenches of contacts on `links` to the rows: the number of independent
    measurements.

    Args:
        measurement: The measurement.
        links: Indices of the touched links, shape (>= count,).
        count: Number of contacts.
        scratch: Shape (>= m, >= 6 * count).
    """
    (rows, m), n = measurement, 6 * count
    for r in range(m):
        size = 0.0
        for i in range(count):
            for k in range(6):
                size = max(size, abs(rows.matrix[links[i], r, k]))
        for i in range(count):
            for k in range(6):
                scratch[r, 6 * i + k] = rows.matrix[links[i], r, k] / size if size > 0.0 else 0.0
    return _eliminated_rank(scratch, m, n)


@fused_kernel
def _eliminated_rank(A: np.ndarray, m: int, n: int) -> int:
    """Rank of the first m rows and n columns of A, whose entries are at most about 1, by Gaussian elimination
    with full pivoting; A is overwritten."""
    rank = 0
    for _ in range(min(m, n)):
        best, row, column = 1e-9, -1, -1
        for r in range(rank, m):
            for c in range(n):
                if abs(A[r, c]) > best:
                    best, row, column = abs(A[r, c]), r, c
        if row < 0:
            break
        for c in range(n):
            A[row, c], A[rank, c] = A[rank, c], A[row, c]
        for r in range(rank + 1, m):
            factor = A[r, column] / A[rank, column]
            for c in range(n):
                A[r, c] -= factor * A[rank, c]
            A[r, column] = 0.0
        rank += 1
    return rank
