"""A share that is large now and then is told all the time, not every second anew; a fault that is over is
not."""

from contactsense.service.sensors.checks.held_share import HOLD, HeldShare
from contactsense.service.sensors.clients.robot_stream import StreamHealth
from contactsense.service.sensors.source_health import SourceHealth

LIMIT = 0.05
TICK = 0.25


def test_a_share_around_its_limit_does_not_flap() -> None:
    held = HeldShare(LIMIT)
    assert held.update(0.0, 0.05) == 0.0  # not above the limit
    assert all(held.update(TICK * (i + 1), 0.07 if i % 4 == 0 else 0.03) for i in range(40))


def test_a_share_is_told_no_more_when_it_has_been_clearly_below() -> None:
    held = HeldShare(LIMIT)
    assert held.update(0.0, 0.2) == 0.2
    assert held.update(HOLD, 0.03) == 0.2
    assert held.update(HOLD + TICK, 0.03) == 0.03  # below the limit, but not clearly
    assert held.update(2.0 * HOLD, 0.01) == 0.03
    assert held.update(2.0 * HOLD + 2.0 * TICK, 0.01) == 0.0
    assert held.update(2.0 * HOLD + 3.0 * TICK, 0.04) == 0.0


def test_a_share_that_keeps_returning_is_held_longer_and_longer() -> None:
    held = HeldShare(LIMIT)
    period = 10  # ticks: a peak every 2.5 s, as on a busy computer
    told = [held.update(TICK * i, 0.2 if i % period == 0 else 0.0) > 0.0 for i in range(20 * period)]
    begins = [i for i in range(1, len(told)) if told[i] and not told[i - 1]]
    assert begins == [period, 2 * period, 3 * period][: len(begins)]
    assert all(told[3 * period :])
    # After a long time without, it is held briefly again.
    later = [held.update(TICK * (20 * period + i), 0.2 if i == 60 else 0.0) > 0.0 for i in range(80)]
    assert [i for i, is_told in enumerate(later) if is_told and i > 30] == [60, 61, 62]


def test_only_connections_are_tried_again() -> None:
    lost = StreamHealth(state="waiting", error="robot at a: mute")
    well = StreamHealth(state="streaming")
    lacking = ("base_wrench: up to 7% of the samples within a second lack the force/torque reading",)

    def told(robot: StreamHealth, reconnects: bool = True) -> str:
        health = SourceHealth(
            robot, wrench=None, unusable=0, without_wrench=0, recent=lacking, reconnects=reconnects
        )
        return health.trouble_while_running

    assert told(well) == lacking[0]
    assert told(lost) == f"robot at a: mute; retrying; {lacking[0]}"
    assert told(lost, reconnects=False) == f"robot at a: mute; {lacking[0]}"
