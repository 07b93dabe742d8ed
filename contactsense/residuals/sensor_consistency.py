"""Sensor consistency monitor: statistics of the residuals of a stream, and exclusion of inconsistent sensors.

Three conditions are monitored. In free motion, each sensor's residual should be as large as stated. In a
contact, base sensor and joint torques should agree: if no link makes them agree for seconds, the torques,
which depend on friction and drives, are excluded. And a base sensor is excluded that measures an implausibly
large force while the joints measure none. An excluded sensor is still monitored, and used again once it is
consistent.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.robots.jit.kernel import kernel

BASE, TORQUE, AGREEMENT, FORCE, NO_CONTACT = 0, 1, 2, 3, 4
"""Indices of `State.statistics`; the last is the energy of the no-contact hypothesis, on which detection
depends."""
UPDATE_PERIOD = 0.02
"""Period of the monitor; residuals are low-passed anyway [s]."""
AVERAGING_TIME = 2.0
"""Averaging time of the statistics [s]."""
TOO_LARGE, FITS_AGAIN = 1.6, 1.3
"""Mean squared residual, in units of its variance, above which a sensor is inconsistent and below which it is
consistent again."""
DISAGREE, AGREE_AGAIN = 4.0, 2.0
"""The same for the two sensors against each other."""
LARGEST_STATISTIC = 10.0
"""Upper bound of a single sample's statistic, so that the mean recovers soon."""
DOUBT_TIME = 3.0
"""A sensor that is inconsistent for this long is excluded [s]."""
IMPLAUSIBLE_FORCE = 10.0
"""A force at the base this many times the usual contact force, without joint torques, is implausible."""
SINCE_UPDATE, FORCE_LIMIT, SINGLE_CONTACT = 0, 1, 2
"""Indices of `SensorConsistency.scalars`."""
_NAMES = ("base_wrench", "joint_torque")


class SensorConsistency(NamedTuple):
    """State of the monitor for one stream."""

    mean_statistic: np.ndarray
    """Running mean of `State.statistics` except the force, shape (3,)."""
    too_large: np.ndarray
    """1 where the residual of base wrench or torques is too large, shape (2,)."""
    excluded: np.ndarray
    """1 where one of the two is excluded, shape (2,)."""
    doubt_time: np.ndarray
    """For how long a sensor has been inconsistent, or consistent again while it is excluded, shape (2,) [s].
    """
    scalars: np.ndarray
    """Time since the last update [s]; smallest implausible force at the base [N]; 1 if only one contact at a
    time is expected. Several contacts may leave no link on which the sensors agree, so torques are then never
    excluded. Shape (3,)."""


def empty_consistency() -> SensorConsistency:
    """State before the first sample; `restart` initializes it."""
    return SensorConsistency(np.zeros(3), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(3))


def restart(consistency: SensorConsistency, force: float, single: bool) -> None:
    """Reset: all sensors consistent.

    Args:
        consistency: Changed in place.
        force: Usual force of contacts [N].
        single: Whether only one contact at a time is expected.
    """
    consistency.mean_statistic[:] = 1.0
    for array in (consistency.too_large, consistency.excluded, consistency.doubt_time):
        array[:] = 0.0
    consistency.scalars[:] = 0.0, IMPLAUSIBLE_FORCE * force, float(single)


@kernel
def exclude_inconsistent(consistency: SensorConsistency, usable: np.ndarray) -> None:
    """Exclude inconsistent sensors if the other is available; `usable`: 1 for sensors that can be used, base
    wrench and torques first; changed in place."""
    if usable[BASE] > 0.0 and usable[TORQUE] > 0.0:
        usable[BASE] -= consistency.excluded[BASE]
        usable[TORQUE] -= consistency.excluded[TORQUE]


@kernel
def update_is_due(consistency: SensorConsistency, dt: float) -> bool:
    """Whether `update_consistency` takes in the statistics of a sample; `dt`: time since the last one [s]."""
    return bool(consistency.scalars[SINCE_UPDATE] + dt >= UPDATE_PERIOD)


@kernel
def update_consistency(
    consistency: SensorConsistency,
    statistics: np.ndarray,
    touched: bool,
    has_base: bool,
    has_torque: bool,
    dt: float,
) -> bool:
    """Process one sample; returns whether any sensor is inconsistent, see `describe_inconsistency`.

    Args:
        consistency: Changed in place.
        statistics: `State.statistics`; read where `update_is_due`.
        touched: Whether a contact is present.
        has_base, has_torque: Which sensors could be used, excluded or not.
        dt: Time since the last sample [s].
    """
    due = update_is_due(consistency, dt)
    consistency.scalars[SINCE_UPDATE] += dt
    if due:
        _update_statistics(
            consistency, statistics, touched, has_base, has_torque, consistency.scalars[SINCE_UPDATE]
        )
        consistency.scalars[SINCE_UPDATE] = 0.0
    return bool(
        consistency.too_large[BASE]
        + consistency.too_large[TORQUE]
        + consistency.excluded[BASE]
        + consistency.excluded[TORQUE]
        > 0.0
    )


@kernel
def _update_statistics(
    consistency: SensorConsistency,
    statistics: np.ndarray,
    touched: bool,
    has_base: bool,
    has_torque: bool,
    elapsed: float,
) -> None:
    weight = min(elapsed / AVERAGING_TIME, 1.0)
    if not touched:
        if has_base:
            _check_residual(consistency, BASE, statistics, weight)
        if has_torque:
            _check_residual(consistency, TORQUE, statistics, weight)
    if has_base and has_torque:
        _update_mean(consistency, AGREEMENT, statistics, weight)
        disagreement = (
            consistency.mean_statistic[AGREEMENT] if consistency.scalars[SINGLE_CONTACT] > 0.0 else 1.0
        )
        force_limit = consistency.scalars[FORCE_LIMIT]
        implausible = statistics[FORCE] > force_limit and statistics[TORQUE] < DISAGREE
        _update_exclusion(consistency, BASE, elapsed, implausible, statistics[FORCE] < 0.5 * force_limit)
        # An excluded base sensor cannot contradict the torques.
        contradicts = disagreement > DISAGREE and consistency.excluded[BASE] == 0.0
        _update_exclusion(consistency, TORQUE, elapsed, contradicts, disagreement < AGREE_AGAIN)


@kernel
def _update_mean(
    consistency: SensorConsistency, statistic: int, statistics: np.ndarray, weight: float
) -> None:
    consistency.mean_statistic[statistic] += weight * (
        min(statistics[statistic], LARGEST_STATISTIC) - consistency.mean_statistic[statistic]
    )


@kernel
def _check_residual(
    consistency: SensorConsistency, sensor: int, statistics: np.ndarray, weight: float
) -> None:
    if consistency.excluded[sensor] == 0.0:
        _update_mean(consistency, sensor, statistics, weight)
        limit = FITS_AGAIN if consistency.too_large[sensor] > 0.0 else TOO_LARGE
        consistency.too_large[sensor] = 1.0 if consistency.mean_statistic[sensor] > limit else 0.0


@kernel
def _update_exclusion(
    consistency: SensorConsistency, sensor: int, dt: float, inconsistent: bool, consistent: bool
) -> None:
    contradicts = consistent if consistency.excluded[sensor] > 0.0 else inconsistent
    consistency.doubt_time[sensor] = consistency.doubt_time[sensor] + dt if contradicts else 0.0
    if consistency.doubt_time[sensor] >= DOUBT_TIME:
        consistency.excluded[sensor] = 1.0 - consistency.excluded[sensor]
        consistency.doubt_time[sensor] = 0.0


def describe_inconsistency(consistency: SensorConsistency) -> list[str]:
    """What is inconsistent, one phrase each."""
    messages = [
        f"{name}: without contact its residual is "
        f"{math.sqrt(consistency.mean_statistic[i]):.1f} times as large as noise and model allow"
        for i, name in enumerate(_NAMES)
        if consistency.too_large[i]
    ]
    if consistency.excluded[BASE]:
        messages.append(
            "base_wrench is excluded: its force is implausibly large, and the joint torques show none"
        )
    if consistency.excluded[TORQUE]:
        messages.append("joint_torque is excluded: it contradicts base_wrench for a contact on any link")
    return messages
