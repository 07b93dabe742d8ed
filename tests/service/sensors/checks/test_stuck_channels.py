"""Single channels that are stuck are found; coarse ones, noiseless ones and those of a real arm are not."""

import copy

import numpy as np
import pytest

from contactsense.service.sensors.checks.plausibility import REST_SPEED
from contactsense.service.sensors.checks.stuck_channels import (
    LEAST_SEEN,
    NEVER_CHANGED,
    STUCK_READINGS,
    StuckChannels,
)
from tests.shared import shared

KNOWN = LEAST_SEEN * STUCK_READINGS
"""So many readings at rest tell the noise of each channel."""


def told(check: StuckChannels, readings: np.ndarray, at_rest: bool) -> list[tuple[int, ...]]:
    """What is stuck at each reading, shape (N, n)."""
    return [check.update(tuple(reading), at_rest) for reading in readings.tolist()]


def noise(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, 6))


@pytest.mark.parametrize("at_rest", [True, False])
@pytest.mark.parametrize("value", [0.0, 1.7, None])
def test_a_channel_that_sticks_is_found_at_once_and_well_at_once(at_rest: bool, value: float | None) -> None:
    check = StuckChannels(6, from_start=False)
    assert not any(told(check, noise(KNOWN), True))
    readings = noise(1000, seed=1)
    readings[100:900, 3] = readings[100, 3] if value is None else value
    found = told(check, readings, at_rest)
    first = next(i for i, channels in enumerate(found) if channels)
    assert STUCK_READINGS <= first - 100 + 1 <= 2 * STUCK_READINGS - 2
    assert set(found[first:900]) == {(3,)}
    assert not any(found[:first] + found[900:])


@pytest.mark.parametrize("readings", [2000, 20_000])
@pytest.mark.parametrize(("counts", "judged"), [(4.0, True), (1.9, False)])
def test_how_coarse_a_channel_may_be(readings: int, counts: float, judged: bool) -> None:
    """Of white noise of so many counts 7 and 15 % of the values repeat, however long the arm rests."""
    check, coarse = StuckChannels(6, from_start=False), np.round(counts * noise(readings))
    told(check, coarse, True)
    moving = np.round(1000.0 * noise(100, seed=1))
    moving[50:, 3] = 7.0
    assert any(told(check, moving, False)) == judged


def test_a_channel_that_was_noisy_once_is_judged_by_what_it_is_now() -> None:
    """As where a simulator takes the place of a robot."""
    check, t = StuckChannels(6, from_start=False), 0.002 * np.arange(20_000)[:, None]
    told(check, noise(20_000), True)
    settling = np.sin(t + np.arange(6))
    told(check, settling, True)
    settling[:, 2] = 1.0
    assert not any(told(check, settling[:100], True))


def test_two_channels_may_be_stuck() -> None:
    check = StuckChannels(6, from_start=False)
    told(check, noise(KNOWN), True)
    readings = noise(200, seed=1)
    readings[50:, 1] = 5.0
    readings[100:, 4] = 5.0
    found = told(check, readings, False)
    assert found[90] == (1,)
    assert found[-1] == (1, 4)


def test_a_channel_that_is_stuck_for_long_is_not_taken_for_a_coarse_one() -> None:
    check = StuckChannels(6, from_start=False)
    told(check, noise(KNOWN), True)
    readings = noise(20_000, seed=1)
    readings[:, 2] = 1.0
    assert set(told(check, readings, True)[20:]) == {(2,)}
    assert not any(told(check, noise(1000, seed=2), True))
    assert told(check, readings[:20], True)[-1] == (2,)


def test_a_whole_reading_that_repeats_is_counted_once() -> None:
    """A sensor is slower than its packets, or everything is frozen, which others tell."""
    check = StuckChannels(6, from_start=False)
    assert not any(told(check, np.repeat(noise(4 * KNOWN), 10, axis=0), True))


@pytest.mark.parametrize("resolution", [0.5, 1.0, 3.0, 10.0])
def test_a_coarse_channel_that_rests_at_a_value_is_believed(resolution: float) -> None:
    """In units of the noise: a coarse channel repeats most of its values at rest, and none in fast motion."""
    check = StuckChannels(6, from_start=True)
    rest, motion = noise(20_000, seed=3), noise(20_000, seed=4)
    motion[:, 2] += 100.0 * np.sin(0.01 * np.arange(len(motion)))
    for readings, at_rest in ((rest, True), (motion, False), (rest + 0.4 * resolution, True)):
        coarse = readings.copy()
        coarse[:, 2] = resolution * np.round(coarse[:, 2] / resolution)
        assert not any(told(check, coarse, at_rest))


def test_a_fine_channel_is_left_out_by_chance_only_once_in_ten_thousand_readings() -> None:
    check = StuckChannels(6, from_start=True)
    rng = np.random.default_rng(5)
    counts = np.round(4.0 * rng.standard_normal((200_000, 6)))  # real currents: some hundred counts
    assert sum(map(bool, told(check, counts, True))) < 20


@pytest.mark.parametrize("from_start", [False, True])
def test_a_simulator_without_noise_is_believed(from_start: bool) -> None:
    """At rest nothing changes, in motion a joint that rests or is upright has a constant torque."""
    check = StuckChannels(6, from_start)
    t = 0.002 * np.arange(5000)[:, None]
    motion = np.sin(t + np.arange(6))
    for constant in (0, 1, 2):
        rest = np.repeat(motion[-1:], 1000, axis=0)
        rest[:, 0] = 0.0
        assert not any(told(check, rest, True))
        moving = motion.copy()
        moving[:, 0] = 0.0
        moving[1000:, constant] = moving[1000, constant]
        assert not any(told(check, moving, False))


@pytest.mark.parametrize("from_start", [False, True])
def test_a_channel_that_is_stuck_from_the_start_is_found_in_motion(from_start: bool) -> None:
    check = StuckChannels(6, from_start)
    expected = (5,) if from_start else ()
    readings = noise(NEVER_CHANGED + STUCK_READINGS)
    readings[:, 5] = 0.0
    assert not any(told(check, readings, True))
    assert not any(told(check, readings[: NEVER_CHANGED // 2], False))
    assert told(check, readings, False)[-1] == expected
    # And stays so when the arm comes to rest again.
    assert set(told(check, readings, True)) == {expected}


def test_a_channel_that_never_changes_is_believed_while_others_are_coarse() -> None:
    check = StuckChannels(6, from_start=True)
    coarse = np.round(0.5 * noise(2 * NEVER_CHANGED))
    coarse[:, 5] = 0.0
    assert not any(told(check, coarse, True))
    assert not any(told(check, coarse, False))


def test_no_motor_current_of_a_real_arm_is_stuck() -> None:
    count = judged = 0
    for path in sorted(shared("ur10e_recordings").glob("*.csv.gz")):
        check = StuckChannels(6, from_start=True)
        numbers = np.loadtxt(path, delimiter=",", usecols=range(19))
        speeds, currents = numbers[:, 7:13], numbers[:, 13:]
        for at_rest, reading in zip(np.abs(speeds).max(axis=1) <= REST_SPEED, currents.tolist(), strict=True):
            assert check.update(tuple(reading), bool(at_rest)) == ()
        count += len(currents)
        # Where the arm has rested for long enough, each of them is judged.
        stuck = currents[-20:].copy()
        for joint in range(6):
            stuck[:, joint] = 1.0
            judged += told(copy.deepcopy(check), stuck, False)[-1] == tuple(range(joint + 1))
    assert count > 70_000
    assert judged >= 6 * 8


@pytest.mark.parametrize("decimals", [16, 9, 6])
def test_smooth_values_of_a_simulator_at_rest_are_no_noise(decimals: int) -> None:
    """Its arm settles, or something pushes it with a varying force; then a torque is constant."""
    check, t = StuckChannels(6, from_start=True), 0.002 * np.arange(5000)[:, None]
    settling = np.exp(-t) * np.sin(3.0 * t + np.arange(6))
    pushed = 10.0 + np.sin(2.0 * t) * np.arange(1, 7)
    pushed[2500:, 2] = 0.0
    for readings in (settling, pushed):
        assert not any(told(check, np.round(readings, decimals), True))
