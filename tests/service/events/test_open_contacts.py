"""Each contact that begins gets a release, also if the process that saw it begin ended first."""

import time
from itertools import pairwise
from pathlib import Path

import pytest

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.events.model import ContactEvent
from contactsense.service.events.open_contacts import OpenContacts
from tests.service import fakes, http
from tests.service.serving import serving


def add(journal: Journal, *events: tuple[str, int]) -> None:
    for t, (kind, contact) in enumerate(events):
        journal.append(
            ContactEvent.model_validate(
                {"kind": kind, "contact": contact, "t": float(t), "link": "forearm", "peak_force": 10.0 + t}
            )
        )


def stored(path: Path) -> list[ContactEvent]:
    with Journal(JournalSettings(path=path)) as journal:
        return [ContactEvent.model_validate_json(body) for body in journal.since(0)]


def test_contacts_that_have_not_ended_are_released_with_what_was_last_known_of_them() -> None:
    with Journal() as journal:
        add(
            journal, ("onset", 1), ("release", 1), ("onset", 2), ("hold", 2), ("onset", 3), ("weight", 3),
            ("resume", 1), ("action", 0),
        )  # fmt: skip
        journal.flush()
        contacts = OpenContacts(journal)
        found = contacts.end("the service", "2026-01-01T00:00:00+00:00")
        assert [(event.contact, event.kind, event.t, event.peak_force) for event in found] == [
            (2, "release", 3.0, 13.0),
            (1, "release", 6.0, 16.0),
        ]
        assert {event.reason for event in found} == {"the service ended; the end of the contact was not seen"}
        assert {event.time for event in found} == {"2026-01-01T00:00:00+00:00"}
        for event in found:
            contacts.note(event)
        assert not contacts.end("the service", "")


def test_an_event_of_a_later_version_keeps_no_service_from_starting(tmp_path: Path) -> None:
    """As after a return to an earlier one."""
    with Journal(JournalSettings(path=tmp_path / "events.db")) as journal:
        add(journal, ("onset", 1), ("onset", 2))
        journal.flush()
        later = "json_set(body, '$.mood', 'bad')"
        journal.database.execute(f"UPDATE events SET body = {later} WHERE id = ?", (journal.last,))
        assert [event.contact for event in OpenContacts(journal).end("the service", "")] == [1]


def test_a_service_releases_once_what_a_killed_one_has_left_open(tmp_path: Path) -> None:
    path = tmp_path / "events.db"
    with Journal(JournalSettings(path=path)) as journal:
        add(journal, ("onset", 1), ("hold", 1))
    settings = Settings.checked({"events": {"path": path}})
    for _ in range(2):
        with serving(create_app(settings)) as place:
            events = http.get(f"http://{place}/v1/events").json()["events"]
            assert [event["kind"] for event in events] == ["onset", "hold", "release"]
            assert events[-1]["time"].endswith("+00:00")
    numbers = [event.id for event in stored(path)]
    assert numbers == sorted(set(numbers))


@pytest.mark.slow
def test_a_process_that_crashes_while_touched_leaves_no_contact_open(tmp_path: Path) -> None:
    """The next process numbers its contacts from 1 on: two of number 1 began without an end in between."""
    path = tmp_path / "events.db"
    with serving(create_app(Settings.checked({"events": {"path": path}}), fakes.Crashing)) as place:
        deadline = time.monotonic() + 280  # kernels may have to be compiled
        while len(http.get(f"http://{place}/v1/events?kind=onset").json()["events"]) < 2:
            assert time.monotonic() < deadline
            time.sleep(0.02)
    found = [event for event in stored(path) if event.kind in ("onset", "release")]
    assert {event.contact for event in found} == {1}
    assert all(one.kind != other.kind for one, other in pairwise(found))
    first, *_, last = (event.reason for event in found if event.kind == "release")
    assert first == "the pipeline's process ended; the end of the contact was not seen"
    assert found[-1].kind == "release"
    assert last.endswith("ended; the end of the contact was not seen")
