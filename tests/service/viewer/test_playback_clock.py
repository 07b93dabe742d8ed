"""The clock of a playback."""

import pytest

from contactsense.service.viewer.playback_clock import PlaybackClock


def test_it_stands_until_it_is_started() -> None:
    clock = PlaybackClock(10.0)
    assert (clock.time(5.0), clock.running(5.0)) == (0.0, False)
    clock.start(100.0)
    assert (clock.time(103.0), clock.running(103.0)) == (3.0, True)
    clock.stop(104.0)
    assert (clock.time(200.0), clock.running(200.0)) == (4.0, False)


def test_it_stops_at_the_end_and_starts_over() -> None:
    clock = PlaybackClock(10.0)
    clock.start(0.0)
    assert (clock.time(11.0), clock.running(11.0)) == (10.0, False)
    clock.start(20.0)
    assert clock.time(21.0) == 1.0


def test_a_change_of_speed_does_not_jump() -> None:
    clock = PlaybackClock(10.0)
    clock.start(0.0)
    clock.set_speed(0.5, 2.0)
    assert clock.time(2.0) == 2.0
    assert clock.time(4.0) == 3.0


@pytest.mark.parametrize(("asked", "found"), [(-1.0, 0.0), (4.0, 4.0), (99.0, 10.0)])
def test_a_jump_stays_within_the_recording(asked: float, found: float) -> None:
    clock = PlaybackClock(10.0)
    clock.jump(asked, 5.0)
    assert clock.time(50.0) == found


def test_a_jump_runs_on_only_where_it_ran() -> None:
    clock = PlaybackClock(10.0)
    clock.start(0.0)
    clock.jump(5.0, 1.0)
    assert clock.time(3.0) == 7.0
    clock.jump(2.0, 20.0)  # it has stood at the end since 6.0
    assert clock.time(30.0) == 2.0
