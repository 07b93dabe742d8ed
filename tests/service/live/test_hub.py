"""The hub: everybody gets everything, the slow lose the oldest and know it."""

import asyncio
import json
import time
from typing import Any

import pytest

from contactsense.service.live.hub import Hub, Reader


def taken(reader: Reader) -> list[bytes]:
    async def all_of_it() -> list[bytes]:
        got = []
        while True:
            try:
                got.append(await asyncio.wait_for(reader.take(), 0.01))
            except TimeoutError:
                return got

    return asyncio.run(all_of_it())


def publish(hub: Hub, count: int, period: float = 0.002) -> None:
    for i in range(count):
        hub.publish(i * period, b"%d" % i)


def test_the_hub_knows_when_the_latest_message_came() -> None:
    hub, begin = Hub(), time.monotonic()
    assert hub.last_arrival < 0.0  # long ago, however long the computer has been running
    publish(hub, 1)
    assert begin <= hub.last_arrival <= time.monotonic()


def test_every_reader_gets_every_message() -> None:
    hub = Hub()
    with hub.subscribe() as a, hub.subscribe() as b:
        assert hub.readers == 2
        publish(hub, 5)
        assert taken(a) == taken(b) == [b"0", b"1", b"2", b"3", b"4"]
    assert hub.readers == 0
    assert hub.last == b"4"


def test_a_slow_reader_loses_the_oldest_and_is_told() -> None:
    hub = Hub(size=3)
    with hub.subscribe() as slow:
        publish(hub, 10)
        assert slow.take_lost() == 7
        assert slow.take_lost() == 0
        assert taken(slow) == [b"7", b"8", b"9"]
        publish(hub, 4)
        assert slow.take_lost() == 1
        assert hub.lost == 8
    assert hub.lost == 8  # still known when the reader has gone


def test_events_without_messages_do_not_fill_the_memory() -> None:
    """A webhook may fail for weeks while the robot is off."""
    hub = Hub()
    for i in range(1500):
        hub.add_event(b"%d" % i)
    hub.publish(0.0, b'{"t":0,"events":[]}')
    assert hub.last is not None
    assert json.loads(hub.last)["events"] == list(range(500, 1500))
    hub.publish(0.0, b'{"t":1,"events":[]}')
    assert hub.last == b'{"t":1,"events":[]}'


def test_what_waits_can_be_forgotten() -> None:
    hub = Hub()
    with hub.subscribe(every=2) as reader:
        hub.add_event(b"{}")
        publish(hub, 3)
        hub.add_event(b"{}")
        publish(hub, 1)
        reader.clear()
        hub.publish(1.0, b'{"t":1,"events":[]}')
        assert taken(reader) == [b'{"t":1,"events":[]}']
        assert reader.take_lost() == 0


@pytest.mark.parametrize("size", [1, 3])
@pytest.mark.parametrize("count", [5, 700])
def test_the_events_of_lost_messages_come_with_the_next_one(size: int, count: int) -> None:
    """In order; of too many the oldest are dropped."""
    reader = Reader(size)
    for i in range(count):
        reader.offer(0.002 * i, b'{"events":[]}', [b"%d" % (2 * i), b"%d" % (2 * i + 1)])
    found = [event for message in taken(reader) for event in json.loads(message)["events"]]
    assert found == list(range(2 * count - len(found), 2 * count))
    assert min(2 * count, 1000) <= len(found) <= 1000 + 2 * (size - 1)


def test_one_in_so_many() -> None:
    hub = Hub()
    with hub.subscribe(every=3) as reader:
        publish(hub, 8)
        assert taken(reader) == [b"0", b"3", b"6"]


@pytest.mark.parametrize("rate", [30, 400])
def test_at_most_so_many_a_second(rate: int) -> None:
    """On average, though no interval is a multiple of the time between two messages."""
    hub = Hub()
    with hub.subscribe(interval=1.0 / rate) as reader:
        publish(hub, 500)
        assert rate <= len(taken(reader)) <= rate + 1


@pytest.mark.parametrize("start", [-0.2, 0.0, 100.0])
def test_the_first_message_is_due_and_one_that_is_nearly_due(start: float) -> None:
    """Time stamps jitter."""
    hub = Hub()
    with hub.subscribe(interval=1.0) as reader:
        for late in (0.0, 0.99, 0.996):
            hub.publish(start + late, b"%d" % round(1000 * late))
        assert taken(reader) == [b"0", b"996"]


@pytest.mark.parametrize("chosen", [{"every": 3}, {"interval": 0.006}])
def test_the_events_of_skipped_messages_come_with_the_next_one(chosen: dict[str, Any]) -> None:
    hub = Hub()
    with hub.subscribe(**chosen) as reader:
        for i in range(7):
            hub.add_event(b"%d" % i)
            hub.publish(0.002 * i, b'{"events":[]}')
        assert [json.loads(message)["events"] for message in taken(reader)] == [[0], [1, 2, 3], [4, 5, 6]]


def test_a_clock_that_jumps_starts_afresh() -> None:
    hub = Hub()
    with hub.subscribe(interval=1.0) as reader:
        for t in (100.0, 100.5, 101.0, 3.0, 3.5, 4.0, 9.3, 9.9, 10.4):
            hub.publish(t, b"%d" % round(10 * t))
        assert taken(reader) == [b"1000", b"1010", b"30", b"40", b"93", b"104"]


def test_waiting_for_the_next_message() -> None:
    async def scenario() -> bytes:
        hub = Hub()
        with hub.subscribe() as reader:
            waiting = asyncio.create_task(reader.take())
            await asyncio.sleep(0)
            hub.publish(0.0, b"here")
            return await waiting

    assert asyncio.run(scenario()) == b"here"
