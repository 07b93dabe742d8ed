"""Readings that cannot be true: frozen ones, and what was wrong lately."""

import math
import time

import numpy as np
import pytest

from contactsense.service.sensors.checks.plausibility import (
    ReadingCheck,
    RecentCounts,
    RepeatCheck,
    RobotCheck,
    SensorEvent,
)
from contactsense.service.sensors.checks.recent_trouble import RecentTrouble
from contactsense.service.sensors.checks.stuck_channels import ArmState

TIMES = np.arange(0.0, 0.2, 0.002)
LIMITS = np.full(6, np.pi)


def test_a_signal_that_changes_is_not_frozen():
    check = RepeatCheck()
    assert [check.update(t, (t,)) for t in TIMES] == [0.0] * len(TIMES)


def test_a_signal_that_repeats_is_frozen_from_its_first_reading_on():
    check = RepeatCheck()
    repeated = [check.update(t, (1.0, 2.0)) for t in TIMES]
    assert repeated[0] == 0.0
    assert repeated[-1] == pytest.approx(0.198)
    assert check.update(0.3, (1.0, 2.1)) == 0.0


def test_a_signal_slower_than_its_packets_is_not_frozen():
    check = RepeatCheck()
    assert max(check.update(t, round(t / 0.008 - 0.5)) for t in TIMES) < 0.04


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_positions_may_repeat_at_rest_but_not_in_motion(sign):
    q, rest, moving = np.zeros(6), np.zeros(6), np.array([0.0, 0.5 * sign, 0.0, 0.0, 0.0, 0.0])
    check = RobotCheck(LIMITS)
    assert not any(check.positions_stale(t, q, rest) for t in TIMES)
    check = RobotCheck(LIMITS)
    stale = [check.positions_stale(t, q, moving) for t in TIMES]
    assert not stale[0]
    assert all(stale[1:])
    check = RobotCheck(LIMITS)
    assert not any(check.positions_stale(t, q + moving * t, moving) for t in TIMES)


def test_positions_are_stale_from_the_moment_at_which_they_should_have_changed():
    """By 0.2 mrad: at 0.03 rad/s after 7 ms."""
    check = RobotCheck(LIMITS)
    stale = [check.positions_stale(t, np.zeros(6), np.full(6, 0.03)) for t in TIMES]
    assert stale == [t > 0.0067 for t in TIMES]


def test_one_absurd_velocity_does_not_make_an_arm_at_rest_stale_for_ever():
    q, rest = np.zeros(6), np.zeros(6)
    check = RobotCheck(LIMITS)
    assert not check.positions_stale(0.0, q, rest)
    assert check.positions_stale(0.002, q, np.full(6, 1e300))
    assert not any(check.positions_stale(t, q, rest) for t in TIMES[2:])


@pytest.mark.parametrize("step", [-50.0, 0.0, 3600.0])
def test_positions_that_repeat_over_a_step_of_the_clock_are_not_stale(step: float) -> None:
    """How long they have repeated is unknown then."""
    q, moving = np.zeros(6), np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    check = RobotCheck(LIMITS)
    assert not check.positions_stale(100.0, q, moving)
    assert check.positions_stale(100.002, q, moving)
    assert not check.positions_stale(100.002 + step, q, moving)
    assert check.positions_stale(100.004 + step, q, moving)


def test_positions_that_repeat_are_stale_again_after_a_rest():
    q, rest, moving = np.zeros(6), np.zeros(6), np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    check = RobotCheck(LIMITS)
    assert not any(check.positions_stale(t, q, rest) for t in TIMES[:50])
    assert all(check.positions_stale(t, q, moving) for t in TIMES[50:])


def test_velocities_far_beyond_the_joints_limits_are_impossible():
    check = RobotCheck(LIMITS)
    assert not check.velocities_impossible(np.full(6, -np.pi))
    assert check.velocities_impossible(np.array([0.0, 0.0, 0.0, 0.0, 0.0, -1e300]))
    for sign in (1.0, -1.0):
        assert not check.velocities_impossible(np.full(6, sign * 2.9 * np.pi))
        assert check.velocities_impossible(np.array([sign * 3.1 * np.pi, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert not RobotCheck(np.full(6, np.inf)).velocities_impossible(np.full(6, 1e300))


def test_whole_packets_that_repeat():
    check = RobotCheck(LIMITS)
    for t in TIMES:
        assert check.all_repeats(t, (1.0, 2.0, 3.0)) == pytest.approx(t)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_reading_of_which_one_component_is_no_number_is_not_believed(wrong: float) -> None:
    recent = RecentCounts()
    for checked in (True, False):
        check = ReadingCheck("base_wrench", checked, recent, ArmState())
        assert check.believes(0.0, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 0.0)
        assert not check.believes(0.002, (1.1, 2.1, 3.1, 4.1, 5.1, wrong), 0.0)
    assert recent.totals(time.monotonic())[SensorEvent("base_wrench", "not finite")] == 2


def test_recent_counts_expire():
    recent = RecentCounts(1.0)
    for t in np.arange(10.0, 12.0, 0.01):
        recent.add(t, "lost")
    assert recent.totals(12.0)["lost"] == pytest.approx(100, abs=11)
    assert recent.totals(12.5)["lost"] == pytest.approx(50, abs=11)
    assert recent.totals(13.1)["lost"] == 0


@pytest.mark.parametrize(
    ("packets", "lost", "told"), [(450, 8, False), (450, 10, True), (10, 4, False), (10, 6, True)]
)
def test_packets_that_are_lost_are_told_from_two_percent_on(packets: int, lost: int, told: bool) -> None:
    """Of those that are expected within a second, at least of half of them: a few at a start are no share."""
    recent = RecentCounts()
    recent.add(5.0, "packets", packets)
    recent.add(5.0, "lost", lost)
    assert bool(RecentTrouble().describe(5.0, recent.totals(5.0), 0.002)) == told


def test_what_was_wrong_is_told_in_words():
    recent = RecentCounts()
    recent.add(5.0, "packets", 450)
    recent.add(5.0, "lost", 45)
    assert RecentTrouble().describe(5.0, recent.totals(5.0), 0.002) == (
        "up to 10% of the robot's packets were lost within a second; check the network and the load of this "
        "computer",
    )
    for field in ("wrist_wrench", "base_wrench"):
        recent.add(5.0, SensorEvent(field, "lacking"), 100)
    recent.add(5.0, SensorEvent("wrist_wrench", "frozen"), 900)
    base, wrist, last = RecentTrouble().describe(5.0, recent.totals(5.0), 0.002)
    assert base == "base_wrench: up to 22% of the samples within a second lack the force/torque reading"
    assert wrist.startswith("wrist_wrench: the force/torque sensor repeats the same reading")
    assert "lost" in last  # and the samples without a reading of the wrist are explained already


@pytest.mark.parametrize("cause", ["", "unaligned", "frozen"])
def test_an_outage_that_is_over_is_told_no_longer_than_two_seconds(cause: str) -> None:
    recent, trouble, period, told = RecentCounts(), RecentTrouble(), 0.002, {}
    for t in np.arange(10.0, 20.0, period):
        recent.add(t, "packets")
        if 11.0 <= t < 13.5:
            recent.add(t, SensorEvent("base_wrench", "lacking"))
            if cause:
                recent.add(t, SensorEvent("base_wrench", cause))
        if round(t / period) % 125 == 0:  # as often as the pipeline reports
            told[t] = trouble.describe(t, recent.totals(t), period)
    told_at = [t for t, text in told.items() if text]
    assert told_at[0] < 11.5
    assert told_at[-1] < 13.5 + 1.8  # and the next report, 0.25 s later, is without it
    assert len(told_at) == round((told_at[-1] - told_at[0]) / 0.25) + 1  # without a break


@pytest.mark.parametrize(
    ("reading", "what"),
    [((math.nan,) * 6, "not finite"), ((0.0, -0.0) * 3, "zero"), ((1.0, 2.0) * 3, "frozen")],
)
def test_readings_that_cannot_be_measurements_are_counted(reading: tuple[float, ...], what: str) -> None:
    recent = RecentCounts()
    check, free = (ReadingCheck("wrist_wrench", checked, recent, ArmState()) for checked in (True, False))
    believed = [check.believes(0.002 * i, reading, 0.005) for i in range(100)]
    # The first of equal readings is a measurement.
    assert believed == [what == "frozen" and i < 3 for i in range(100)]
    counts = recent.totals(time.monotonic())
    assert set(counts) == {SensorEvent("wrist_wrench", what)}
    assert counts[SensorEvent("wrist_wrench", what)] == (79 if what == "frozen" else 100)
    assert check.believes(0.2, (1.0, 3.0) * 3, 0.005)
    # A simulator may send the same numbers all the time, but numbers.
    assert free.believes(1.0, reading, 0.005) == free.believes(2.0, reading, 0.005) == (what != "not finite")


def test_a_stuck_component_is_counted_by_its_number() -> None:
    recent, arm, rng = RecentCounts(), ArmState(at_rest=True), np.random.default_rng(0)
    check, free = (ReadingCheck("base_wrench", checked, recent, arm) for checked in (True, False))
    for i in range(500):
        reading = rng.standard_normal(6)
        reading[3] = 4.0 if i >= 400 else reading[3]
        believed = check.believes(0.001 * i, reading.tolist(), 0.0)
        assert believed == (i < 400) or 400 <= i < 410
        assert free.believes(0.001 * i, reading.tolist(), 0.0)
    assert set(recent.totals(time.monotonic())) == {SensorEvent("base_wrench", "stuck", 3)}
    assert check.believes(0.5, rng.standard_normal(6).tolist(), 0.0)


def test_stuck_components_and_late_and_lost_readings_are_told_in_words() -> None:
    recent = RecentCounts()
    recent.add(5.0, "packets", 500)
    recent.add(5.0, SensorEvent("joint_torque", "stuck", 2), 300)
    recent.add(5.0, SensorEvent("base_wrench", "stuck", 3), 300)
    recent.add(5.0, SensorEvent("base_wrench", "stuck", 0), 2)  # by chance
    recent.add(5.0, SensorEvent("base_wrench", "lacking"), 300)
    recent.add(5.0, SensorEvent("wrist_wrench", "lacking"), 300)
    recent.add(5.0, SensorEvent("wrist_wrench", "late"), 300)
    base, torque, wrist = RecentTrouble().describe(5.0, recent.totals(5.0), 0.002)
    assert base.startswith("base_wrench[3]: this value stays the same")
    assert torque.startswith("joint_torque[2]: this value stays the same")
    assert wrist.startswith("wrist_wrench: the force/torque readings arrive later than before")


@pytest.mark.parametrize(("share", "is_told"), [(0.3, False), (0.9, True)])
def test_the_share_of_lost_readings_is_told_instead_of_what_the_samples_lack(
    share: float, is_told: bool
) -> None:
    recent = RecentCounts()
    recent.add(5.0, "packets", 500)
    recent.add(5.0, SensorEvent("base_wrench", "lost"), round(1000 * share))
    recent.add(5.0, SensorEvent("base_wrench", "received"), round(1000 * (1.0 - share)))
    recent.add(5.0, SensorEvent("base_wrench", "lacking"), round(400 * share**4))
    told = RecentTrouble().describe(5.0, recent.totals(5.0), 0.002)
    assert [text[:44] for text in told] == ["base_wrench: up to 90% of the readings withi"] * is_told


def test_a_rare_loss_is_not_worth_a_word():
    recent = RecentCounts()
    recent.add(5.0, "packets", 499)
    recent.add(5.0, "lost", 1)
    assert RecentTrouble().describe(5.0, recent.totals(5.0), 0.002) == ()
