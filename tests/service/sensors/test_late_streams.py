"""Streams that are late, at first or from some time on: simulated clocks and networks."""

import math

import numpy as np
import pytest

from contactsense.service.sensors.time_alignment import Aligner, ClockMap
from tests.service.sensors.simulated_arrivals import NS, arrivals, held_up


@pytest.mark.parametrize("seed", range(6))
def test_a_stream_that_is_late_only_at_first_is_not_called_late(seed: int) -> None:
    """As from a host that is busy at the start: it catches up, faster than its own clock runs."""
    rng = np.random.default_rng(seed)
    robot, sensor = np.arange(0.0, 14.0, 0.002), np.arange(0.0, 14.0, 0.001)
    late = rng.uniform(0.02, 0.3) * np.maximum(0.0, 1.0 - sensor / rng.uniform(2.6, 4.6))
    events = [(at, 0, k) for k, at in enumerate(arrivals(rng, 500.0 + robot))]
    events += [(at, 1, k) for k, at in enumerate(arrivals(rng, 500.0 + sensor + late))]
    aligner = Aligner(max_age=0.005)
    for arrival, kind, k in sorted(events):
        if kind:
            aligner.add(k, int(arrival), [sensor[k]] * 6)
            continue
        aligner.observe_robot(robot[k], int(arrival))
        if k % 10 == 0 and robot[k] > 10.0:
            assert not aligner.is_late
            found = aligner.at(robot[k] - 0.02).wrench
            assert found is not None
            assert found[0] == pytest.approx(robot[k] - 0.02, abs=1e-3)


def become_late(late_sensor: float, late_robot: float, *, seconds: float = 90.0):
    """Streams of which one becomes later after 10 s; yields (aligner, time [s], its error [s] or NaN).

    The reading is asked for 50 ms after the sample, when it has come in any case.
    """
    robot, sensor = np.arange(0.0, seconds, 0.002), np.arange(0.0, seconds, 0.001) * (1.0 + 5e-5)
    events = []
    for kind, own, late in ((0, robot, late_robot), (1, sensor, late_sensor)):
        at = arrivals(np.random.default_rng(kind), 500.0 + own + late * (own > 10.0))
        events += [(a, kind, k) for k, a in enumerate(at)]
    aligner = Aligner(max_age=0.005)
    for arrival, kind, k in sorted(events):
        if kind:
            aligner.add(k, int(arrival), [sensor[k]] * 6)
        else:
            aligner.observe_robot(robot[k], int(arrival))
            if k % 20 == 0 and k > 1000:
                found = aligner.at(robot[k] - 0.05).wrench
                yield aligner, robot[k], math.nan if found is None else found[0] - (robot[k] - 0.05)


@pytest.mark.parametrize("late", [0.008, 0.02, 0.3])
def test_a_sensor_that_becomes_later_is_told_and_keeps_its_clock(late: float) -> None:
    """Also when it has been late for longer than arrivals are remembered."""
    errors = []
    for aligner, t, error in become_late(late, 0.0):
        assert aligner.is_late == (t > 10.0) or 10.0 < t < 10.5 + late
        assert not aligner.robot_is_late
        errors.append(error)
    # Readings that have come are still those of the robot's instant; after 0.3 s none has.
    assert np.isnan(errors).any() == (late > 0.05)
    assert np.nanmax(np.abs(errors)) < 3e-4


@pytest.mark.parametrize("late_sensor", [0.0, 0.02])
def test_a_robot_that_becomes_later_keeps_its_clock(late_sensor: float) -> None:
    """It is told if that lasts, unless the sensor becomes as late."""
    errors = []
    for aligner, t, error in become_late(late_sensor, 0.02):
        transition = 10.0 < t < 10.6  # blocks of the two streams end at different times
        assert transition or not aligner.is_late
        lasts = t > 20.0 and late_sensor == 0.0
        assert aligner.robot_is_late == lasts or 20.0 < t < 21.0
        errors.append(error)
    assert np.abs(errors).max() < 3e-4


def test_a_few_late_arrivals_around_an_outage_are_no_late_stream() -> None:
    clock = ClockMap(1.0)
    for k in range(5000):
        clock.observe(k * 0.002, int(k * 0.002 * NS))
    for k in range(5000, 8000, 500):
        clock.observe(k * 0.002, int((k * 0.002 + 0.05) * NS))
        assert not clock.is_late


def clock_of(*lateness: tuple[float, float]) -> ClockMap:
    """A clock that ticks each 2 ms, after arrivals that were late by so much until these times [s]."""
    clock, begin = ClockMap(1.0), 0
    for end, late in lateness:
        for k in range(begin, round(end / 0.002)):
            clock.observe(k * 0.002, round((k * 0.002 + late) * NS))
        begin = round(end / 0.002)
    return clock


@pytest.mark.parametrize("first", [0.0, 0.02])
@pytest.mark.parametrize(("late", "is_late"), [(0.004, False), (0.006, True), (0.7, True), (1.5, False)])
def test_lateness_is_counted_from_the_least_delayed_arrival(first: float, late: float, is_late: bool) -> None:
    """Not from the first one; what is later than a second is a clock that stood still."""
    clock = clock_of((0.002, first), (8.0, 0.0), (8.6, late))
    assert clock.late == pytest.approx(late, abs=1e-5)
    assert clock.is_late == is_late


def test_an_arrival_that_is_less_delayed_than_all_before_counts_at_once() -> None:
    """Not only from the next block on."""
    late, in_time = clock_of((3.0, 0.02)), clock_of((3.0, 0.02), (3.1, 0.0))
    assert late.host(3.0) == pytest.approx(3.0, abs=2e-3)  # of arrivals that are all late nothing is known
    assert in_time.host(3.0) == pytest.approx(3.0 - 0.02, abs=2e-3)


@pytest.mark.parametrize("interval", [0.002, 0.4])
def test_no_reading_is_taken_for_one_after_its_arrival(interval: float) -> None:
    """Even the first one of a block, as is each of a slow sensor."""
    rng, clock = np.random.default_rng(0), ClockMap(1.0)
    for k in range(200):
        arrival = k * interval + rng.exponential(0.01)
        clock.observe(k * interval, round(arrival * NS))
        assert clock.host(k * interval) + clock.origin_ns / NS <= arrival + 1e-8


@pytest.mark.parametrize(("late_robot", "ready"), [(0.0, False), (0.02, True)])
def test_both_streams_late_soon_after_the_start_are_aligned_as_before(late_robot: float, ready: bool) -> None:
    """A sensor that alone is late so soon may have been in time before, or be in time now."""
    aligner = Aligner(period=1e-3)
    for k in range(4000):
        t, late = k * 1e-3, k > 2500
        aligner.add(k, round((t + 0.02 * late) * NS), [t] * 6)
        if k % 2 == 0:
            aligner.observe_robot(t, round((t + late_robot * late) * NS))
    assert aligner.ready == ready
    found = aligner.at(3.5).wrench
    assert (found is not None) == ready
    assert found is None or found[0] == pytest.approx(3.5, abs=1e-6)


def test_a_network_that_becomes_a_little_later_is_not_told() -> None:
    assert not any(aligner.is_late for aligner, *_ in become_late(0.004, 0.0, seconds=30.0))


@pytest.mark.parametrize("seed", range(3))
def test_readings_on_a_host_without_time_are_not_called_late(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot, sensor = 500.0 + np.arange(0.0, 15.0, 0.002), 500.0 + np.arange(0.0, 15.0, 0.001)
    events = [(at, 0, k) for k, at in enumerate(held_up(rng, arrivals(rng, robot), 0.4))]
    events += [(at, 1, k) for k, at in enumerate(held_up(rng, arrivals(rng, sensor), 0.4))]
    aligner = Aligner()
    for arrival, kind, k in sorted(events):
        if kind:
            aligner.add(k, int(arrival), [0.0] * 6)
        else:
            aligner.observe_robot(robot[k] - 500.0, int(arrival))
            assert not aligner.is_late
            assert not aligner.robot_is_late
