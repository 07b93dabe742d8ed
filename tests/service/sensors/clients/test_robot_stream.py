"""Counting losses, and when to try again."""

import math

import pytest

from contactsense.service.sensors.clients.robot_stream import (
    NS,
    Backoff,
    LossCounter,
    RobotRecord,
    StreamHealth,
)


def count(*stamps, period=0.002, late=0.0):
    """Admit records with these stamps, arriving as taken; returns what was admitted and the counters."""
    health = StreamHealth()
    counter = LossCounter(period, health)
    admitted = [s for s in stamps if counter.admit(RobotRecord(s, int((s + late) * NS), (s,)))]
    return admitted, health


def test_no_gap_no_loss():
    admitted, health = count(*[k * 0.002 for k in range(1000)])
    assert len(admitted) == health.received == 1000
    assert (health.lost, health.duplicates, health.jumps) == (0, 0, 0)


def test_gaps_are_counted_in_samples():
    _, health = count(0.0, 0.002, 0.006, 0.014)
    assert health.lost == 1 + 3


def test_jitter_of_the_stamps_is_no_loss():
    _, health = count(0.0, 0.0021, 0.0039, 0.0061)
    assert health.lost == 0


def test_repetitions_are_not_delivered():
    admitted, health = count(0.0, 0.002, 0.002, 0.004)
    assert admitted == [0.0, 0.002, 0.004]
    assert health.duplicates == 1


def test_time_that_jumps_back_is_a_jump_and_goes_on():
    admitted, health = count(100.0, 100.002, 3.0, 3.002)
    assert admitted == [100.0, 100.002, 3.0, 3.002]
    assert (health.jumps, health.lost) == (1, 0)


def test_swapped_packets_are_put_right_by_leaving_out_the_late_one():
    admitted, health = count(0.002, 0.0, 0.006, 0.004, 0.010, 0.008)
    assert admitted == [0.002, 0.006, 0.010]
    assert (health.out_of_order, health.jumps) == (3, 0)


@pytest.mark.parametrize(("back", "late"), [(0.4, True), (0.6, False)])
def test_half_a_second_tells_a_late_packet_from_a_clock_that_was_set_back(back, late):
    admitted, health = count(100.0, 100.0 - back)
    assert len(admitted) == 2 - late
    assert (health.out_of_order, health.jumps) == (int(late), int(not late))


def test_a_clock_set_back_a_little_is_another_clock_after_a_while():
    stamps = [100.0 + 0.002 * k for k in range(5)] + [99.8 + 0.002 * k for k in range(20)]
    admitted, health = count(*stamps)
    assert (health.out_of_order, health.jumps) == (10, 1)
    assert admitted[-10:] == stamps[-10:]


def test_a_clock_far_ahead_is_a_jump_but_an_outage_is_a_loss():
    health = StreamHealth()
    counter = LossCounter(0.002, health)
    counter.admit(RobotRecord(0.0, 0, (0.0,)))
    counter.admit(RobotRecord(3.0, 3 * NS, (3.0,)))
    assert (health.jumps, health.lost) == (0, 1499)
    counter.admit(RobotRecord(5000.0, 3 * NS + 2_000_000, (5000.0,)))
    assert (health.jumps, health.lost) == (1, 1499)


@pytest.mark.parametrize(("ahead", "jumps"), [(0.9, 0), (1.1, 1)])
def test_a_clock_that_is_a_second_ahead_of_the_arrivals_has_jumped(ahead, jumps):
    """Whenever the host was started: arrivals count from then on."""
    health = StreamHealth()
    counter = LossCounter(0.002, health)
    up = 10_000 * NS
    counter.admit(RobotRecord(0.0, up, (0.0,)))
    counter.admit(RobotRecord(0.002 + ahead, up + NS // 500, (0.0,)))
    assert (health.jumps, health.lost) == (jumps, 0 if jumps else round(ahead / 0.002))


def test_times_that_are_no_numbers_are_refused():
    admitted, health = count(0.0)
    counter = LossCounter(0.002, health)
    assert not counter.admit(RobotRecord(math.nan, 0, (math.nan,)))
    assert health.error == "the robot sent the time stamp nan"
    assert (health.failures, health.bad_stamps) == (1, 1)
    assert admitted == [0.0]


def test_backoff_doubles_up_to_its_limit_and_starts_over():
    backoff = Backoff(0.1, 0.3)
    assert backoff.wait(0) == 0.0
    backoff.failed(0)
    assert backoff.wait(0) == pytest.approx(0.1)
    assert backoff.wait(NS // 20) == pytest.approx(0.05)
    assert backoff.wait(NS) == 0.0
    backoff.failed(NS)
    assert backoff.wait(NS) == pytest.approx(0.2)
    backoff.failed(NS)
    backoff.failed(NS)
    assert backoff.wait(NS) == pytest.approx(0.3)
    backoff.succeeded()
    backoff.failed(NS)
    assert backoff.wait(NS) == pytest.approx(0.1)
