"""A service runs for months: the journal must not grow without bound, in its file or in memory."""

import sqlite3
import time
from itertools import pairwise
from pathlib import Path

import pytest

from contactsense.service.events import journal as journals
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.events.model import ContactEvent
from tests.service.loopback import until


def event(n: int) -> ContactEvent:
    return ContactEvent.model_validate({"kind": "onset", "contact": n, "t": 0.5 * n, "link": "forearm"})


def filled(journal: Journal, count: int) -> None:
    for i in range(count):
        journal.append(event(i))
    journal.flush()


def test_events_in_memory_have_a_smaller_limit_than_those_in_a_file() -> None:
    with Journal(JournalSettings(max_memory=0.3)) as journal:
        begin = journal.last
        filled(journal, 3000)
        journal.prune()
        kept = journal.since(begin, 10_000)
        assert 0 < sum(map(len, kept)) < 0.3e6
        assert '"contact":2999' in kept[-1]  # the oldest go first


@pytest.mark.parametrize("days", [0.0, 31.0], ids=["size", "age"])
def test_others_get_the_journal_while_events_are_removed(
    days: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The service sends nothing while it waits for the journal."""
    monkeypatch.setattr(journals, "_REMOVED", 100)
    monkeypatch.setattr(journals, "_VACUUM_PAGES", 10)
    with Journal(JournalSettings(path=tmp_path / "j.db", max_size=0.05)) as journal:
        filled(journal, 1000)
        left: list[tuple[int, int]] = []

        class Lock:
            """Notes how many events and pages there are each time that others could have it."""

            def __enter__(self) -> None:
                lock.acquire()

            def __exit__(self, *_: object) -> None:
                (events,) = journal.database.execute("SELECT count(*) FROM events").fetchone()
                (pages,) = journal.database.execute("PRAGMA page_count").fetchone()
                left.append((events, pages))
                lock.release()

        lock = journal.lock
        with monkeypatch.context() as patch:
            patch.setattr(journal, "lock", Lock())
            journal.prune(time.time() + 86400.0 * days)
        assert left[-1][0] < 200
        assert left[-1][1] < 0.5 * left[0][1]
        for before, after in pairwise(left):
            assert before[0] - after[0] <= 100
            assert before[1] - after[1] <= 10


def test_the_end_of_the_service_does_not_wait_until_events_are_removed(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        filled(journal, 1000)
        journal._closing.set()
        journal.prune(time.time() + 31.0 * 86400.0)
        assert len(journal.since(0, 10_000)) == 1000


def test_the_file_gets_smaller_when_events_are_removed(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        filled(journal, 3000)
        journal.database.execute("PRAGMA wal_checkpoint").fetchall()
        before = path.stat().st_size
        journal.database.execute("DELETE FROM events")
        journal.prune()
        journal.database.execute("PRAGMA wal_checkpoint").fetchall()
        assert path.stat().st_size < 0.1 * before


def test_a_large_change_leaves_no_large_log_beside_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journals, "_WAL_SIZE", 100_000)
    path = tmp_path / "j.db"
    log = tmp_path / "j.db-wal"
    with Journal(JournalSettings(path=path)) as journal:
        filled(journal, 3000)
        assert log.stat().st_size > 300_000
        journal.database.execute("PRAGMA wal_checkpoint").fetchall()
        filled(journal, 1)
        assert log.stat().st_size <= 100_000


def test_what_waits_for_a_full_disk_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journals, "_MOST_WAITING", 50)
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        filled(journal, 1)
        journal.database.execute("PRAGMA busy_timeout=10")
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        begin = journal.last
        filled(journal, 120)
        assert until(lambda: "cannot be written" in journal.error)
        waiting = journal.since(begin)
        assert len(waiting) == 50
        assert '"contact":119' in waiting[-1]
        other.execute("COMMIT")
        other.close()
        assert until(lambda: not journal.error)
        assert journal.since(begin) == waiting


@pytest.mark.parametrize("step", [-90.0, 90.0])
def test_events_keep_their_age_where_the_clock_is_set(step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer without a battery for its clock starts in the past."""
    real, days = time.time, 0.0
    monkeypatch.setattr(time, "time", lambda: real() + 86400.0 * days)
    with Journal() as journal:
        begin = journal.last
        filled(journal, 1)
        days = step
        filled(journal, 1)
        journal.prune()
        assert len(journal.since(begin)) == 2
        journal.prune(time.time() + 31.0 * 86400.0)
        assert journal.since(begin) == []
