"""Packets that wait for readings in later ones."""

import pytest

from contactsense.service.sensors.clients.robot_stream import NS, RobotRecord
from contactsense.service.sensors.held_packets import HeldPackets


def packet(t: float, arrival: float | None = None) -> RobotRecord:
    return RobotRecord(t, round((t if arrival is None else arrival) * NS), ())


@pytest.mark.parametrize("wait", [0.0, 0.003, 0.004, 0.02])
def test_each_waits_for_one_that_is_later_by_the_wait(wait: float) -> None:
    held = HeldPackets(wait)
    taken: list[float] = []
    for k in range(100):
        newest = 0.002 * k
        taken += [record.timestamp for record in held.after(packet(newest))]
        assert taken == [0.002 * i for i in range(len(taken))]
        if taken:
            assert newest - taken[-1] >= wait - 1e-9
        assert newest - 0.002 * len(taken) < wait + 1e-9


def test_a_clock_that_is_set_back_ends_the_wait() -> None:
    held = HeldPackets(0.01)
    assert not [*held.after(packet(5.0)), *held.after(packet(5.002))]
    assert [record.timestamp for record in held.after(packet(1.0))] == [5.0, 5.002]


def test_a_robot_that_falls_silent_ends_the_wait() -> None:
    held = HeldPackets(0.01)
    assert not list(held.after(packet(5.0, arrival=100.0)))
    assert not list(held.overdue(round(100.05 * NS)))
    assert [record.timestamp for record in held.overdue(round(100.07 * NS))] == [5.0]
    assert not list(held.overdue(round(101.0 * NS)))
