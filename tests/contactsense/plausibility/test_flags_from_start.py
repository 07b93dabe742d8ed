"""Which flags of a stream's first samples mean that its readings have never fitted a free arm."""

import numpy as np
import pytest

from contactsense.plausibility.stream_start import StreamStart
from contactsense.sensors.stream_state import (
    ALL_MISSING,
    BLIND,
    INCONSISTENT,
    MISSING,
    REPEATED,
    RESTARTED,
    SETTLING,
    TOUCHED,
    UNUSABLE,
)

STEP, BANDWIDTH = 0.01, 10.0
SETTLED = 5.0 / (2.0 * np.pi * BANDWIDTH)
"""The observers have settled [s]; a contact that was there before shows within another 0.1 s."""
ALONE = ALL_MISSING & ~MISSING
"""Flags of a stream of which only the first sensor has values."""


def doubted(*spans: tuple[float, int], averages: bool = False) -> list[tuple[float, float]]:
    """First and last time of each run of samples that belong to what has been there since the start.

    `spans`: until when [s], and the flags of the samples until then.
    """
    start, runs, before, begin = StreamStart(BANDWIDTH, averages), [], False, 0
    for end, flags in spans:
        for k in range(begin, round(end / STEP)):
            now = start.update(k * STEP, flags)
            if now and not before:
                runs.append([k * STEP, k * STEP])
            if now:
                runs[-1][1] = k * STEP
            before = now
        begin = round(end / STEP)
    return [(round(first, 6), round(last, 6)) for first, last in runs]


@pytest.mark.parametrize("noise", [SETTLING, BLIND])
@pytest.mark.parametrize(
    ("averages", "begin", "doubt"),
    [(False, 0.17, True), (False, 0.19, False), (True, 0.57, True), (True, 0.59, False)],
)
def test_a_contact_is_doubted_that_shows_as_soon_as_the_observers_have_settled(
    averages: bool, begin: float, doubt: bool, noise: int
) -> None:
    """Those of the average, too, where it is tested. Samples that tell nothing do not count."""
    found = doubted((SETTLED, noise | TOUCHED), (begin, 0), (3.0, TOUCHED), averages=averages)
    assert found == ([(begin, 2.99)] if doubt else [])


@pytest.mark.parametrize(("begin", "doubt"), [(5.9, True), (6.1, False)])
def test_inconsistent_sensors_are_doubted_that_show_within_three_averaging_times(
    begin: float, doubt: bool
) -> None:
    assert doubted((begin, 0), (8.0, INCONSISTENT)) == ([(begin, 7.99)] if doubt else [])


def test_what_comes_after_a_contact_that_was_not_there_from_the_start_is_not_doubted() -> None:
    assert doubted((1.0, 0), (2.0, TOUCHED), (3.0, INCONSISTENT), (4.0, TOUCHED)) == []


@pytest.mark.parametrize("unfit", [TOUCHED, INCONSISTENT])
def test_the_doubt_ends_once_the_arm_has_been_free_for_a_second(unfit: int) -> None:
    """What comes then was not there from the start."""
    assert doubted((2.0, TOUCHED), (2.9, 0), (4.0, unfit), (5.1, 0), (7.0, unfit)) == [
        (0.0, 1.99),
        (2.9, 3.99),
    ]


def test_nothing_is_doubtful_any_more_once_the_doubt_has_ended() -> None:
    start = StreamStart(BANDWIDTH, False)
    for t in np.arange(0.0, 3.0, STEP):
        start.update(float(t), TOUCHED if t < 1.0 else 0)
        assert start.doubtful == (t < 1.995)


def test_samples_without_information_are_not_free_ones() -> None:
    assert doubted((1.0, TOUCHED), (3.0, SETTLING), (4.0, TOUCHED)) == [(0.0, 0.99), (3.0, 3.99)]


@pytest.mark.parametrize("unused", [UNUSABLE, REPEATED])
def test_samples_that_are_not_used_change_nothing(unused: int) -> None:
    assert doubted((1.0, TOUCHED), (3.0, unused), (4.0, TOUCHED)) == [(0.0, 0.99), (3.0, 3.99)]
    assert doubted((0.1, unused | RESTARTED | TOUCHED), (8.0, 0), (9.0, TOUCHED)) == []
    assert doubted((1.0, unused), (2.0, TOUCHED)) == [(1.0, 1.99)]  # the stream begins with the first that is


def test_samples_without_flags_matter_until_all_is_decided_and_all_sensors_have_joined() -> None:
    start = StreamStart(BANDWIDTH, False)
    for i, t in enumerate(np.arange(0.0, 8.0, STEP)):
        start.update(float(t), ALONE)
        assert start.watches, i
    for t in np.arange(8.0, 16.0, STEP):
        start.update(float(t), 0)
        assert start.watches == (t <= 14.001)


def test_another_stream_has_a_start_of_its_own() -> None:
    held = (9.0, TOUCHED)
    assert doubted((8.0, 0), held) == []
    assert doubted((8.0, 0), (8.01, RESTARTED | TOUCHED), held) == [(8.0, 8.99)]


def test_a_sensor_that_joins_later_has_a_start_of_its_own() -> None:
    assert doubted((8.0, ALONE), (9.0, ALONE | TOUCHED)) == []
    assert doubted((8.0, ALONE), (9.0, TOUCHED)) == [(8.0, 8.99)]
    # But what is doubted already goes on.
    assert doubted((2.0, ALONE | TOUCHED), (3.0, TOUCHED), (4.5, 0), (5.0, TOUCHED)) == [(0.0, 2.99)]


@pytest.mark.parametrize("seed", range(5))
def test_a_block_is_taken_like_its_samples(seed: int) -> None:
    chance = np.random.default_rng(seed)
    kinds = [0, TOUCHED, INCONSISTENT, SETTLING | TOUCHED, ALONE, ALONE | TOUCHED, RESTARTED | TOUCHED, BLIND]
    flags = np.repeat(chance.choice(kinds, 40, p=[0.3, 0.3, *[0.4 / 6] * 6]), chance.integers(1, 60, 40))
    t = STEP * np.arange(len(flags))
    one, blocks = StreamStart(BANDWIDTH, False), StreamStart(BANDWIDTH, False)
    for begin in range(0, len(t), 37):
        for i in range(begin, min(begin + 37, len(t))):
            one.update(float(t[i]), int(flags[i]))
        blocks.update_block(t[begin : begin + 37], flags[begin : begin + 37])
        assert blocks.doubtful == one.doubtful
