"""Alignment of two streams by their arrivals: simulated clocks and networks, no sockets, no waiting."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.service.sensors.time_alignment import Aligner, ClockMap
from tests.service.sensors.simulated_arrivals import NS, arrivals, delays, held_up


def test_without_jitter_the_map_is_exact():
    clock = ClockMap(1.0)
    assert not clock.ready
    for k in range(2000):
        clock.observe(50.0 + k * 0.002, 7_000_000_000 + k * 2_000_000)
    assert clock.ready
    assert clock.origin_ns == 7_000_000_000
    assert clock.host(50.5) == pytest.approx(0.5, abs=1e-9)
    assert clock.tick(0.5) == pytest.approx(50.5, abs=1e-9)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 10**6), st.floats(-2e-4, 2e-4), st.floats(0.0, 1e6), st.booleans())
def test_jitter_and_drift(seed, drift, start, known):
    rng = np.random.default_rng(seed)
    own = np.arange(0.0, 30.0, 0.002)
    host = 1000.0 + own * (1.0 + drift)
    scale = 1.0 if known else 1000.0  # a clock that counts milliseconds, whose period nobody tells
    clock = ClockMap(1.0 if known else None)
    errors = []
    for x, at, true in zip(own, arrivals(rng, host), host, strict=True):
        clock.observe(start + x * scale, int(at))
        if x > 5.0:
            told = clock.origin_ns / NS + clock.host(start + x * scale)
            errors.append(told - true - 3e-4)
    assert np.abs(errors).max() < 1e-4
    assert clock.period * scale == pytest.approx(1.0 + drift, abs=3e-5)


@pytest.mark.parametrize("seed", range(5))
def test_a_busy_host_that_hears_in_bursts(seed):
    # Half of the time it is held up by 5 to 40 ms and then hears all at once.
    rng = np.random.default_rng(seed)
    own = np.arange(10_000)
    host = own * 1e-3
    arrival = host + delays(rng, len(own))
    begin = 0.0
    while begin < 10.0:
        end = begin + rng.uniform(0.005, 0.04)
        held = (arrival >= begin) & (arrival < end)
        arrival[held] = end
        begin = end + rng.uniform(0.005, 0.04)
    clock = ClockMap(None)
    errors = []
    for tick, at in zip(own, arrival, strict=True):
        clock.observe(int(tick), int(at * NS))
        if clock.ready:
            told = clock.origin_ns / NS + clock.host(int(tick))
            errors.append((tick, told - tick * 1e-3 - 3e-4))
    ticks, error = np.transpose(errors)
    assert ticks[0] < 400
    assert np.abs(error).max() < 5e-3
    assert np.abs(error[ticks > 2000]).max() < 5e-4


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("period", [None, 1e-3])
def test_a_start_on_a_host_without_time_uses_no_reading_of_another_instant(seed, period):
    rng = np.random.default_rng(seed)
    robot, sensor = 500.0 + np.arange(0.0, 3.0, 0.002), 500.0 + np.arange(0.0, 3.0, 0.001)
    events = [(at, 0, k) for k, at in enumerate(held_up(rng, arrivals(rng, robot), 0.1))]
    events += [(at, 1, k) for k, at in enumerate(held_up(rng, arrivals(rng, sensor), 0.1))]
    aligner = Aligner(period=period, max_age=0.005)
    used, errors = [], []
    for arrival, kind, k in sorted(events):
        if kind:
            aligner.add(k, int(arrival), [sensor[k]] * 6)
            continue
        aligner.observe_robot(robot[k] - 500.0, int(arrival))
        value = aligner.at(robot[k] - 500.0)
        if value.wrench is not None:
            used.append(robot[k] - 500.0)
            errors.append(value.wrench[0] + value.age - robot[k])
    assert used[0] < 1.0
    assert len(errors) > 300
    assert np.abs(errors).max() < 5e-3


def test_a_clock_steeper_than_any_quartz_is_taken_for_jitter():
    clock = ClockMap(1.0)
    for k in range(5000):
        clock.observe(k * 0.002, int(k * 0.002 * 1.1 * NS))
    assert clock.period == pytest.approx(1.0 + 5e-4)


def run(*, seed=0, rate=1000.0, seconds=20.0, late=0.0, first_tick=0, **options):
    """Both streams in order of arrival; yields (aligner, robot's time stamp, host time) at each robot sample.

    The sensor's values are the host time of its reading: an aligned value tells the time it stands for.
    """
    rng = np.random.default_rng(seed)
    robot_own = np.arange(0.0, seconds, 0.002)
    robot_host = 500.0 + robot_own * (1.0 - 3e-5)
    ticks = np.arange(int(seconds * rate))
    sensor_host = 500.0 + ticks / rate * (1.0 + 5e-5)
    events = [(a, 0, k) for k, a in enumerate(arrivals(rng, robot_host))]
    events += [(a, 1, k) for k, a in enumerate(arrivals(rng, sensor_host + late))]
    aligner = Aligner(**options)
    for arrival, kind, k in sorted(events):
        if kind:
            aligner.add((first_tick + int(ticks[k])) & 0xFFFFFFFF, int(arrival), [sensor_host[k]] * 6)
        else:
            aligner.observe_robot(robot_own[k], int(arrival))
            yield aligner, robot_own[k], robot_host[k]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate", [500.0, 1000.0, 7000.0])
def test_values_are_of_the_robots_instant(seed, rate):
    errors, ages = [], []
    for aligner, stamp, host in run(seed=seed, rate=rate, seconds=10.0):
        if stamp > 3.0:
            value = aligner.at(stamp)
            if value.wrench is not None:
                errors.append(value.wrench[0] - host + value.age)
                ages.append(value.age)
    assert len(errors) > 3450
    # What is told about the age is true as well.
    assert np.abs(errors).max() < 1e-4
    assert min(ages) >= 0.0
    assert max(ages) <= 0.01
    assert np.median(ages) < 1.0 / rate + 2e-4


@pytest.mark.parametrize("period", [None, 1e-3])
def test_an_idle_host_aligns_within_a_quarter_of_a_second(period):
    stamps = (stamp for aligner, stamp, _ in run(seconds=1.0, period=period) if aligner.ready)
    assert 0.2 <= next(stamps) <= 0.25


def test_later_readings_replace_held_ones():
    stamps = []
    for aligner, stamp, host in run(seconds=6.0):
        stamps.append((stamp, host))
        if len(stamps) > 2000:
            past, at_past = stamps[-10]  # 20 ms ago: readings on both sides have come
            value = aligner.at(past)
            assert value.age == 0.0
            assert value.wrench[0] == pytest.approx(at_past, abs=1e-4)
            assert aligner.covers(past)


@pytest.mark.parametrize(("told", "error"), [(0.0, -0.004), (0.004, 0.0)])
def test_a_known_delay_is_taken_off(told, error):
    errors = []
    for aligner, stamp, host in run(late=0.004, seconds=6.0, delay=told):
        if stamp > 4.0:
            errors.append(aligner.at(stamp - 0.02).wrench[0] - (host - 0.02))
    assert np.median(errors) == pytest.approx(error, abs=2e-4)


def test_a_silent_sensor_gives_nothing_and_not_its_last_value():
    aligner = Aligner(max_age=0.01)
    for k in range(300):
        aligner.add(k, k * 1_000_000, [float(k)] * 6)
    for k in range(200):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    held = aligner.at(0.304)
    assert held.wrench is not None
    assert held.wrench[0] == 299.0
    assert held.age == pytest.approx(0.005, abs=1e-6)
    assert not aligner.covers(0.304)
    gone = aligner.at(0.310)
    assert gone.wrench is None
    assert gone.age == pytest.approx(0.011, abs=1e-6)


@pytest.mark.parametrize("earlier", [range(0), range(0, 500, 20)])
def test_a_slow_sensors_reading_is_used_until_the_next_one_is_overdue(earlier):
    """Its readings are further apart than the age allowed: each is used for 1.5 intervals. It may have
    started anew."""
    aligner = Aligner(period=1e-3, max_age=0.01)
    for k in earlier:
        aligner.add(1_000_000 + k, (k - 1000) * 1_000_000, [0.0] * 6)
    for k in range(0, 2000, 20):
        aligner.add(k, k * 1_000_000, [float(k)] * 6)
    for k in range(1000):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    between = aligner.at(1.955)
    assert between.wrench is not None
    assert between.wrench[0] == pytest.approx(1955.0, abs=1e-3)
    held = aligner.at(1.980 + 0.029)
    assert held.wrench is not None
    assert held.wrench[0] == 1980.0
    assert aligner.at(1.980 + 0.031).wrench is None


def test_a_gap_makes_no_reading_newer():
    """After ten lost readings a sample still waits for the reading of its instant."""
    aligner = Aligner(period=1e-3)
    for k in [*range(300), 310]:
        aligner.add(k, k * 1_000_000, [float(k)] * 6)
    for k in range(200):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    assert aligner.covers(0.3104)
    assert not aligner.covers(0.3106)


def test_a_gap_is_not_bridged():
    aligner = Aligner(max_age=0.01)
    for k in [*range(100), *range(200, 300)]:
        aligner.add(k, k * 1_000_000, [float(k)] * 6)
    for k in range(150):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    assert aligner.at(0.150).wrench is None
    assert aligner.at(0.150).age == pytest.approx(0.051, abs=1e-6)
    held = aligner.at(0.104)
    assert held.wrench is not None
    assert held.age == pytest.approx(0.005, abs=1e-6)
    between = aligner.at(0.2505)
    assert between.wrench is not None
    assert between.wrench[0] == pytest.approx(250.5, abs=1e-3)


def test_before_anything_was_heard_there_is_nothing():
    aligner = Aligner()
    assert aligner.at(0.0).wrench is None
    assert math.isinf(aligner.at(0.0).age)
    assert not aligner.covers(0.0)
    for k in range(300):
        aligner.observe_robot(10.0 + k * 0.002, k * 2_000_000)
        aligner.add(k, k * 1_000_000, [0.0] * 6)
    assert aligner.at(5.0).wrench is None  # before the first reading
    assert aligner.at(10.05).wrench is not None


def test_the_sensors_number_may_run_over():
    errors = [
        value.wrench[0] - host + value.age
        for aligner, stamp, host in run(first_tick=2**32 - 5000, seconds=10.0)
        if stamp > 3.0 and (value := aligner.at(stamp)).wrench is not None
    ]
    assert len(errors) > 3400
    assert np.abs(errors).max() < 1e-4


def test_a_sensor_that_starts_anew_is_learned_anew():
    aligner = Aligner()
    for k in range(3000):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    for k in range(3000):
        aligner.add(500_000 + k, k * 1_000_000, [k * 1e-3] * 6)
    assert aligner.at(2.0).wrench[0] == pytest.approx(2.0, abs=1e-6)
    aligner.add(0, 3_000_000_000, [3.0] * 6)
    assert aligner.at(2.0).wrench is None
    for k in range(1, 300):
        aligner.add(k, 3_000_000_000 + k * 1_000_000, [3.0 + k * 1e-3] * 6)
    assert aligner.at(3.05).wrench[0] == pytest.approx(3.05, abs=1e-6)


def test_numbers_that_run_ahead_of_their_arrivals_are_another_clock():
    aligner = Aligner()
    for k in range(3000):
        aligner.observe_robot(k * 0.002, k * 2_000_000)
    for k in range(3000):
        aligner.add(k, k * 1_000_000, [k * 1e-3] * 6)
    for k in range(3000, 3300):
        aligner.add(1_000_000 + k, k * 1_000_000, [k * 1e-3] * 6)
    assert aligner.at(3.25).wrench[0] == pytest.approx(3.25, abs=1e-6)


def test_a_robot_that_starts_anew_is_learned_anew():
    aligner = Aligner()
    for k in range(5000):
        aligner.add(k, k * 1_000_000, [k * 1e-3] * 6)
    for k in range(1000):
        aligner.observe_robot(700.0 + k * 0.002, k * 2_000_000)
    assert aligner.at(701.0).wrench[0] == pytest.approx(1.0, abs=1e-6)
    for k in range(1000):
        aligner.observe_robot(k * 0.002, 2_500_000_000 + k * 2_000_000)
    assert aligner.at(1.0).wrench[0] == pytest.approx(3.5, abs=1e-6)


def test_a_robots_clock_that_is_set_ahead_and_back_is_learned_anew():
    aligner = Aligner(period=1e-3)
    errors = []
    for k in range(20_000):
        arrival = 10**13 + k * 1_000_000  # the host has been running for hours
        aligner.add(k, arrival, [float(k)] * 6)
        if k % 2 == 0:
            ahead = 100.0 if 5_000 <= k < 10_000 else 0.0
            stamp = k * 1e-3 + ahead
            aligner.observe_robot(stamp, arrival)
            found = aligner.at(stamp).wrench
            errors.append(math.nan if found is None else abs(found[0] - k))
    assert np.nanmax(errors) < 0.1  # milliseconds
    assert np.isnan(errors).sum() < 3 * 0.3 * 500  # the robot's clock is learned three times


def test_the_same_reading_twice_is_one():
    aligner = Aligner()
    for k in range(300):
        for _ in range(2):
            aligner.add(k, k * 1_000_000, [k * 1e-3] * 6)
        aligner.observe_robot(k * 0.001, k * 1_000_000)
    assert aligner.at(0.0505).wrench[0] == pytest.approx(0.0505, abs=1e-6)


def told(aligner: Aligner, instant: float) -> float:
    """Value at an instant of the robot, NaN if there is none."""
    found = aligner.at(instant).wrench
    return math.nan if found is None else float(found[0])


def feed(aligner: Aligner, begin: float, end: float, *, robot: bool = True, sensor: bool = True) -> None:
    """Both streams for some time [s], without delay; the sensor's values are the time."""
    for k in range(round(begin * 1000), round(end * 1000)):
        if sensor:
            aligner.add(k, k * 1_000_000, [k * 1e-3] * 6)
        if robot and k % 2 == 0:
            aligner.observe_robot(k * 1e-3, k * 1_000_000)


@pytest.mark.parametrize("known", ["robot", "sensor"])
def test_nothing_is_aligned_until_both_clocks_are_known(known):
    """At the start, and when both have been forgotten."""
    aligner = Aligner(period=1e-3)
    feed(aligner, 0.0, 1.0, robot=known == "robot", sensor=known == "sensor")
    feed(aligner, 1.0, 1.01)
    assert not aligner.ready
    feed(aligner, 1.01, 2.0)
    assert told(aligner, 1.9) == pytest.approx(1.9)
    aligner.forget()
    feed(aligner, 2.0, 3.0, robot=known == "robot", sensor=known == "sensor")
    feed(aligner, 3.0, 3.01)
    assert math.isnan(told(aligner, 3.0))
    feed(aligner, 3.01, 4.0)
    assert told(aligner, 3.9) == pytest.approx(3.9)


@pytest.mark.parametrize("silent", ["robot", "sensor"])
def test_what_was_silent_for_a_while_keeps_its_clock(silent):
    aligner = Aligner(period=1e-3)
    feed(aligner, 0.0, 4.0)
    feed(aligner, 4.0, 9.0, robot=silent != "robot", sensor=silent != "sensor")
    feed(aligner, 9.0, 9.01)
    assert told(aligner, 9.005) == pytest.approx(9.005, abs=1e-5)


def test_old_readings_are_not_kept():
    aligner = Aligner(period=1e-3, keep=100)
    feed(aligner, 0.0, 1.0)
    assert told(aligner, 0.95) == pytest.approx(0.95)
    assert math.isnan(told(aligner, 0.85))
