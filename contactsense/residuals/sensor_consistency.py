"""Sensor consistency monitor: statistics of the residuals of a stream, and exclusion of inconsistent sensors.

Three conditions are monitored. In free motion, each sensor's residual should be as large as stated. In a
contact, base sensor and joint torques should agree: if no link makes them agree for seconds, the torques,
which depend on friction and drives, are excluded. And a base sensor is excluded that measures an implausibly
large force while the joints measure none. An excluded sensor is still monitored, and used again once it is
consistent.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import kernel
from contactsense.sensors.stream_state import BASE, TORQUE

AGREEMENT, FORCE = 2, 3
"""Indices of `State.statistics` behind those of the two sensors, `BASE` and `TORQUE`."""
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
_NAMES = ("base_wrench", "joint_torque")


@record
class SensorDoubt:
    """Whether one sensor is consistent with the others and the model."""

    too_large: bool
    """Whether its residual is too large."""
    excluded: bool
    doubt_time: float
    """For how long it has been inconsistent, or consistent again while it is excluded [s]."""


@record
class MonitorStatus:
    """What the monitor knows besides its statistics."""

    time_since_update: float
    """[s]"""
    force_limit: float
    """Smallest implausible force at the base [N]."""
    single_contact: bool
    """Whether only one contact at a time is expected. Several contacts may leave no link on which the sensors
    agree, so torques are then never excluded."""


class SensorConsistency(NamedTuple):
    """State of the monitor for one stream."""

    mean_statistic: Annotated[Floats, "3"]
    """Running mean of `State.statistics` except the force."""
    doubt: Annotated[Records[SensorDoubt], "2"]
    """Of base wrench and torques."""
    status: Annotated[Records[MonitorStatus], "1"]


def restart(consistency: SensorConsistency, force: float, single: bool) -> None:
    """Reset: all sensors consistent.

    Args:
        consistency: Changed in place.
        force: Usual force of contacts [N].
        single: Whether only one contact at a time is expected.
    """
    consistency.mean_statistic[:] = 1.0
    np.asarray(consistency.doubt).fill(0)
    status = consistency.status[0]
    status.time_since_update, status.force_limit = 0.0, IMPLAUSIBLE_FORCE * force
    status.single_contact = single


@kernel
def exclude_inconsistent(consistency: SensorConsistency, usable: np.ndarray) -> None:
    """Exclude inconsistent sensors if the other is available; `usable`: 1 for sensors that can be used, base
    wrench and torques first, int64; changed in place."""
    if usable[BASE] > 0 and usable[TORQUE] > 0:
        for sensor in (BASE, TORQUE):
            if consistency.doubt[sensor].excluded:
                usable[sensor] = 0


@kernel
def update_is_due(consistency: SensorConsistency, dt: float) -> bool:
    """Whether `update_consistency` takes in the statistics of a sample; `dt`: time since the last one [s]."""
    return consistency.status[0].time_since_update + dt >= UPDATE_PERIOD


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
    due, status = update_is_due(consistency, dt), consistency.status[0]
    status.time_since_update += dt
    if due:
        _update_statistics(consistency, statistics, touched, has_base, has_torque, status.time_since_update)
        status.time_since_update = 0.0
    base, torque = consistency.doubt[BASE], consistency.doubt[TORQUE]
    return base.too_large or torque.too_large or base.excluded or torque.excluded


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
        disagreement = consistency.mean_statistic[AGREEMENT] if consistency.status[0].single_contact else 1.0
        force_limit = consistency.status[0].force_limit
        implausible = statistics[FORCE] > force_limit and statistics[TORQUE] < DISAGREE
        _update_exclusion(consistency, BASE, elapsed, implausible, statistics[FORCE] < 0.5 * force_limit)
        # An excluded base sensor cannot contradict the torques.
        contradicts = disagreement > DISAGREE and not consistency.doubt[BASE].excluded
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
    doubt = consistency.doubt[sensor]
    if not doubt.excluded:
        _update_mean(consistency, sensor, statistics, weight)
        limit = FITS_AGAIN if doubt.too_large else TOO_LARGE
        doubt.too_large = consistency.mean_statistic[sensor] > limit


@kernel
def _update_exclusion(
    consistency: SensorConsistency, sensor: int, dt: float, inconsistent: bool, consistent: bool
) -> None:
    doubt = consistency.doubt[sensor]
    contradicts = consistent if doubt.excluded else inconsistent
    doubt.doubt_time = doubt.doubt_time + dt if contradicts else 0.0
    if doubt.doubt_time >= DOUBT_TIME:
        doubt.excluded = not doubt.excluded
        doubt.doubt_time = 0.0


def describe_inconsistency(consistency: SensorConsistency) -> list[str]:
    """What is inconsistent, one phrase each."""
    messages = [
        f"{name}: without contact its residual is "
        f"{math.sqrt(consistency.mean_statistic[i]):.1f} times as large as noise and model allow"
        for i, name in enumerate(_NAMES)
        if consistency.doubt[i].too_large
    ]
    if consistency.doubt[BASE].excluded:
        messages.append(
            "base_wrench is excluded: its force is implausibly large, and the joint torques show none"
        )
    if consistency.doubt[TORQUE].excluded:
        messages.append("joint_torque is excluded: it contradicts base_wrench for a contact on any link")
    return messages
