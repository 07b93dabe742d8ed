"""Events as readers meet them: none is missed, in thinned streams, after a break, or while stalled."""

import asyncio
import json
import reprlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import FastAPI
from websockets.sync.client import connect

from contactsense.service.api.app import create_app
from contactsense.service.api.http import errors
from contactsense.service.api.routes.events import router
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.events.journal import Journal, JournalError, JournalSettings
from contactsense.service.events.model import ContactEvent
from contactsense.service.live.hub import Hub, Reader
from tests.service import fakes, http
from tests.service.events.damaged_journal import damaged_journal
from tests.service.serving import serving


@contextmanager
def serving_events(journal: Journal) -> Iterator[str]:
    app = FastAPI()
    app.state.service = SimpleNamespace(journal=journal)
    app.include_router(router)
    errors.install(app)
    with serving(app) as place:
        yield place


@pytest.fixture
def served() -> Iterator[tuple[Journal, str]]:
    with Journal() as journal, serving_events(journal) as place:
        yield journal, place


def add(journal: Journal, *numbers: int, reason: str = "") -> None:
    for n in numbers:
        journal.append(ContactEvent(kind="onset" if n % 2 else "release", contact=n, reason=reason))


def test_events_since_a_number(served: tuple[Journal, str]) -> None:
    journal, place = served
    begin = journal.last
    add(journal, *range(6))
    answer = http.get(f"http://{place}/v1/events", params={"since": begin + 2, "limit": 3}).json()
    assert [event["contact"] for event in answer["events"]] == [2, 3, 4]
    assert answer["last"] == begin + 6
    onsets = http.get(f"http://{place}/v1/events", params={"since": begin, "kind": "onset"}).json()
    assert [event["contact"] for event in onsets["events"]] == [1, 3, 5]


@pytest.mark.parametrize(
    "query",
    ["since=-1", "limit=0", "limit=100000", "kind=touch", "since=1e400", f"since={5000 * '1'}"],
    ids=reprlib.repr,
)
def test_wrong_queries_are_refused(served: tuple[Journal, str], query: str) -> None:
    answer = http.get(f"http://{served[1]}/v1/events?{query}")
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["reason"].startswith("expected ")


def test_a_reader_that_comes_back_gets_what_it_missed_and_then_what_comes(
    served: tuple[Journal, str],
) -> None:
    journal, place = served
    begin = journal.last
    add(journal, 0, 1, 2)
    with connect(f"ws://{place}/v1/events?since={begin + 1}") as stream:
        assert [json.loads(stream.recv(5))["contact"] for _ in range(2)] == [1, 2]
        add(journal, 3)
        assert json.loads(stream.recv(5))["contact"] == 3
    with connect(f"ws://{place}/v1/events") as stream:
        add(journal, 4)
        assert json.loads(stream.recv(5))["contact"] == 4


def test_a_reader_of_another_journal_gets_all_events(served: tuple[Journal, str]) -> None:
    """The service was started with a new journal, whose numbers are smaller."""
    journal, place = served
    ahead = journal.last + 10**6
    add(journal, 0, 1)
    with connect(f"ws://{place}/v1/events?since={ahead}") as stream:
        assert [json.loads(stream.recv(5))["contact"] for _ in range(2)] == [0, 1]
        add(journal, 2)
        assert json.loads(stream.recv(5))["contact"] == 2
    answer = http.get(f"http://{place}/v1/events", params={"since": ahead}).json()
    assert [event["contact"] for event in answer["events"]] == [0, 1, 2]
    assert answer["last"] < ahead


def test_a_reader_that_stalls_misses_none(served: tuple[Journal, str]) -> None:
    journal, place = served
    count = 3000
    with connect(f"ws://{place}/v1/events?since={journal.last}", max_queue=1) as stream:
        for n in range(count):
            add(journal, n, reason="x" * 1000)  # 3 MB: more than the sockets hold
            if n % 500 == 0:
                time.sleep(0.02)
        assert [json.loads(stream.recv(10))["contact"] for _ in range(count)] == list(range(count))


def test_an_event_of_a_later_version_is_passed_on(served: tuple[Journal, str]) -> None:
    """As in a journal that was written before a return to an earlier one."""
    journal, place = served
    begin = journal.last
    add(journal, 0, 1)
    journal.flush()
    later = "json_set(body, '$.mood', 'bad')"
    journal.database.execute(f"UPDATE events SET body = {later} WHERE id = ?", (begin + 1,))
    with connect(f"ws://{place}/v1/events?since={begin}") as stream:
        assert [json.loads(stream.recv(5))["contact"] for _ in range(2)] == [0, 1]


def test_a_damaged_file_is_told_and_the_stream_goes_on(tmp_path: Path) -> None:
    with (
        Journal(JournalSettings(path=damaged_journal(tmp_path))) as journal,
        serving_events(journal) as place,
    ):
        answer = http.get(f"http://{place}/v1/events?limit=10000")
        assert answer.status_code == 500
        told = answer.json()["errors"][0]["reason"]
        assert "j.db: the journal cannot be read: database disk image is malformed" in told
        with connect(f"ws://{place}/v1/events?since=0") as stream:
            while "errors" not in (message := json.loads(stream.recv(5))):
                assert message["kind"] == "onset"
            assert message["errors"] == [{"field": "since", "reason": told}]
            add(journal, 5000)
            assert json.loads(stream.recv(5))["contact"] == 5000


def test_an_event_that_comes_while_a_damaged_file_is_read_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = Journal.read

    def slow(journal: Journal, *query: Any) -> Any:
        try:
            return read(journal, *query)
        except JournalError:
            add(journal, 7)
            raise

    monkeypatch.setattr(Journal, "read", slow)
    with (
        Journal(JournalSettings(path=damaged_journal(tmp_path))) as journal,
        serving_events(journal) as place,
        connect(f"ws://{place}/v1/events?since=0") as stream,
    ):
        while "errors" not in json.loads(stream.recv(5)):
            pass
        assert json.loads(stream.recv(5))["contact"] == 7


def events_of(reader: Reader, messages: int) -> list[int]:
    async def take() -> list[bytes]:
        return [await reader.take() for _ in range(messages)]

    return [event for message in asyncio.run(take()) for event in json.loads(message)["events"]]


def test_thinned_and_slow_streams_carry_the_events_between() -> None:
    hub = Hub(size=3)
    with hub.subscribe(every=10) as thinned, hub.subscribe(interval=0.1) as slowed, hub.subscribe() as slow:
        for i in range(101):
            if i % 7 == 3:
                hub.add_event(b"%d" % i)
            hub.publish(0.002 * i, b'{"t":0,"events":[]}')
        expected = list(range(3, 101, 7))
        assert events_of(thinned, 3) == expected  # also those of the messages that it lost
        assert events_of(slow, 3) == expected
        assert events_of(slowed, 3) == expected


@pytest.mark.slow
def test_a_contact_is_an_event_in_the_stream_and_in_the_journal() -> None:
    with serving(create_app(Settings(), fakes.Steady)) as place:
        deadline = time.monotonic() + 280  # kernels may have to be compiled
        while not (found := http.get(f"http://{place}/v1/events").json()["events"]):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert found[0]["kind"] == "onset"
        assert found[0]["link"] == "forearm"
        assert found[0]["force"] > 0.0
        assert found[0]["id"] > 0
        assert found[0]["time"].endswith("+00:00")


def test_a_journal_that_cannot_be_opened_is_a_wrong_setting() -> None:
    with pytest.raises(SettingsError, match="cannot be used as a journal"):
        create_app(Settings.checked({"events": {"path": "/nonexistent/folder/journal.db"}}))
