"""The journal: every event has its number at once, and outlives the process."""

import contextlib
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest

from contactsense.service.events import file_check
from contactsense.service.events.file_check import FileCheck
from contactsense.service.events.journal import Journal, JournalError, JournalSettings
from contactsense.service.events.model import ContactEvent
from tests.service.events.damaged_journal import damaged_journal
from tests.service.loopback import until


def event(n: int, kind: str = "onset") -> ContactEvent:
    return ContactEvent.model_validate({"kind": kind, "contact": n, "t": 0.5 * n, "link": "forearm"})


def contacts(bodies: list[str]) -> list[int]:
    return [ContactEvent.model_validate_json(body).contact for body in bodies]


def test_events_are_numbered_and_readable_at_once() -> None:
    with Journal() as journal:
        begin = journal.last
        numbered = [journal.append(event(i, "onset" if i % 2 else "release")) for i in range(5)]
        assert [e.id - begin for e in numbered] == [1, 2, 3, 4, 5]
        assert contacts(journal.since(begin)) == [0, 1, 2, 3, 4]
        assert contacts(journal.since(begin + 2, 2)) == [2, 3]
        assert contacts(journal.since(begin, kinds=["onset"])) == [1, 3]
        journal.flush()
        journal.append(event(9))
        assert contacts(journal.since(begin + 3)) == [3, 4, 9]  # committed and waiting ones


def test_none_is_read_twice_or_missed_while_others_write() -> None:
    with Journal() as journal:
        seen, begin = [], journal.last

        def write() -> None:
            for i in range(2000):
                journal.append(event(i))
                if i % 97 == 0:
                    journal.flush()

        writer = threading.Thread(target=write)
        writer.start()
        cursor = begin
        while len(seen) < 2000:
            for body in journal.since(cursor, 50):
                found = ContactEvent.model_validate_json(body)
                cursor = found.id
                seen.append(found.contact)
        writer.join()
        assert seen == list(range(2000))


def test_numbers_go_on_after_closing(tmp_path: Path) -> None:
    settings = JournalSettings(path=tmp_path / "journal.db")
    with Journal(settings) as journal:
        last = [journal.append(event(i)).id for i in range(3)][-1]
    with Journal(settings) as journal:
        assert journal.append(event(3)).id == last + 1
        assert contacts(journal.since(0)) == [0, 1, 2, 3]


def test_numbers_go_on_in_another_journal(tmp_path: Path) -> None:
    with Journal() as journal:
        last = journal.append(event(0)).id
    for name in ("journal.db", "another.db"):
        until(lambda last=last: time.time_ns() // 1_000_000 >= last)  # type: ignore[misc]
        with Journal(JournalSettings(path=tmp_path / name)) as journal:
            first = journal.append(event(1)).id
            assert first > last
            assert contacts(journal.since(last)) == [1]
            last = first


def test_a_number_of_another_journal_is_before_all_events() -> None:
    with Journal() as journal:
        ahead = journal.last + 10**6
        assert journal.since(ahead) == []
        for i in range(3):
            journal.append(event(i))
        assert contacts(journal.since(ahead)) == [0, 1, 2]
        assert contacts(journal.since(ahead, 2)) == [0, 1]
        assert journal.since(journal.last) == []


WRITER = """
import sys, time
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.events.model import ContactEvent
journal = Journal(JournalSettings(path=sys.argv[1]))
while True:
    journal.append(ContactEvent(kind="onset", t=time.time()))
    print(journal.last, time.time(), flush=True)
    time.sleep(0.005)
"""


@pytest.mark.slow
def test_a_killed_process_loses_at_most_a_second_and_no_number_is_given_twice(tmp_path: Path) -> None:
    path = tmp_path / "journal.db"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    told = [process.stdout.readline().split() for _ in range(500)]
    os.kill(process.pid, signal.SIGKILL)
    told += [line.split() for line in process.stdout.read().splitlines()]
    process.wait()
    process.stdout.close()
    last, end = int(told[-1][0]), float(told[-1][1])
    with Journal(JournalSettings(path=path)) as journal:
        kept = [ContactEvent.model_validate_json(body) for body in journal.since(0, 10_000)]
        assert all(a.id + 1 == b.id for a, b in pairwise(kept))  # nothing missing in between
        assert kept[0].id == int(told[0][0])
        assert len(kept) > 300
        assert kept[-1].t > end - 1.0
        assert journal.append(event(0)).id > last


def test_two_services_do_not_share_a_journal(tmp_path: Path) -> None:
    path = tmp_path / "journal.db"
    with (
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True
        ) as process,
    ):
        assert process.stdout is not None
        process.stdout.readline()
        try:
            with pytest.raises(JournalError, match=r"journal\.db: .*another service uses it"):
                Journal(JournalSettings(path=path))
            # Others may read it, such as a program that makes statistics.
            with contextlib.closing(sqlite3.connect(path)) as reader:
                assert reader.execute("SELECT count(*) FROM events").fetchone()[0] >= 0
        finally:
            process.kill()
    # A process that was killed leaves the journal to the next one.
    for _ in range(2):
        with Journal(JournalSettings(path=path)) as journal:
            journal.append(event(0))


def test_age_and_size_are_limited(tmp_path: Path) -> None:
    with Journal(JournalSettings(path=tmp_path / "j.db", max_age=1.0, max_size=0.3)) as journal:
        for i in range(3000):
            journal.append(event(i))
        journal.flush()
        journal.prune()
        kept = contacts(journal.since(0, 10_000))
        assert 0 < len(kept) < 3000
        assert kept[-1] == 2999  # the oldest go first
        assert kept == list(range(kept[0], 3000))
        journal.prune(time.time() + 2 * 86400)
        assert journal.since(0) == []


def test_old_events_that_cannot_be_removed_are_told_until_they_can(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contactsense.service.events.journal._PRUNE_EVERY", 0.0)
    with Journal(JournalSettings()) as journal:
        journal.append(event(0))
        journal.flush()
        with journal.lock:
            journal.database.execute("UPDATE events SET stored = 0")
            journal.database.execute(
                "CREATE TRIGGER kept BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'it is kept'); END"
            )
        told = "old events cannot be removed from the journal: it is kept"
        assert until(lambda: journal.error == told)
        journal.append(event(1))
        journal.flush()
        assert journal.error == told
        with journal.lock:
            journal.database.execute("DROP TRIGGER kept")
        assert until(lambda: journal.error == "")


def test_events_that_cannot_be_written_are_told_although_old_ones_are_removed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("contactsense.service.events.journal._PRUNE_EVERY", 0.0)
    removals: list[float] = []
    monkeypatch.setattr(Journal, "prune", lambda _: removals.append(time.monotonic()))
    with Journal(JournalSettings()) as journal:
        with journal.lock:
            journal.database.execute(
                "CREATE TRIGGER full BEFORE INSERT ON events BEGIN SELECT RAISE(ABORT, 'it is full'); END"
            )
        journal.append(event(0))
        journal.flush()
        before = len(removals)
        assert until(lambda: len(removals) > before + 1)
        assert "the journal cannot be written: it is full" in journal.error
        with journal.lock:
            journal.database.execute("DROP TRIGGER full")
        assert until(lambda: journal.error == "")


def test_a_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    path.write_text("something else" * 100)
    with pytest.raises(JournalError, match=r"j\.db: cannot be used as a journal of events"):
        Journal(JournalSettings(path=path))


def test_what_is_damaged_in_the_file_is_told_and_new_events_are_read(tmp_path: Path) -> None:
    path = damaged_journal(tmp_path)
    with Journal(JournalSettings(path=path)) as journal:
        begin = journal.last
        told = r"j\.db: the journal cannot be read: database disk image is malformed: "
        with pytest.raises(JournalError, match=told):
            journal.since(0, 10_000)
        for n in range(2):
            journal.append(event(n))
            assert contacts(journal.since(begin + n)) == [n]
            journal.flush()
            assert re.match(rf".*{told}", journal.error)
        assert contacts(journal.since(begin + 1)) == [1]
        assert journal.since(begin + 2) == []


def test_damage_that_nobody_has_read_is_told_soon_after_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    with Journal(JournalSettings(path=damaged_journal(tmp_path))) as journal:
        assert until(lambda: journal.error)
        assert "j.db: the journal cannot be read: database disk image is malformed: " in journal.error
        assert contacts(journal.since(journal.append(event(5)).id - 1)) == [5]


@pytest.mark.parametrize(
    ("code", "text", "told"),
    [
        (sqlite3.SQLITE_IOERR_READ, "disk I/O error", ["disk I/O error"]),
        (sqlite3.SQLITE_INTERRUPT, "interrupted", []),
        (sqlite3.SQLITE_CANTOPEN, "unable to open database file", []),
    ],
)
def test_a_file_that_the_disk_cannot_read_is_damaged(
    code: int, text: str, told: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is gone is not: the journal says so itself."""

    def fail(*_: object, **__: object) -> None:
        error = sqlite3.OperationalError(text)
        error.sqlite_errorcode = code
        raise error

    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    monkeypatch.setattr(sqlite3, "connect", fail)
    found: list[str] = []
    check = FileCheck(tmp_path / "j.db", found.append, found.append)
    check._thread.join(20.0)
    assert found == told


def test_the_check_of_the_file_ends_with_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise events would stay in the log beside the file."""
    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    for _ in range(20):
        with Journal(JournalSettings(path=tmp_path / "j.db")) as journal:
            journal.append(event(1))
        assert not journal.error
        assert sorted(file.name for file in tmp_path.iterdir()) == ["j.db", "j.db-lock"]


def test_a_file_that_is_too_damaged_to_be_opened_is_told_with_what_helps(tmp_path: Path) -> None:
    path = damaged_journal(tmp_path)
    with path.open("r+b") as file:
        file.truncate(8 * 4096)
    with pytest.raises(JournalError, match=r"j\.db: cannot be used .* malformed: .*, move the file away"):
        Journal(JournalSettings(path=path))


def test_a_full_disk_is_named_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite says "disk I/O error"."""
    path = tmp_path / "j.db"
    path.write_text("something else" * 100)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=4096))
    with pytest.raises(JournalError, match=r"j\.db: cannot be used as a journal of events: the disk is full"):
        Journal(JournalSettings(path=path))


def test_a_journal_that_cannot_be_written_keeps_what_waits(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        journal.flush()
        other = sqlite3.connect(path, isolation_level=None)
        journal.database.execute("PRAGMA busy_timeout=10")
        other.execute("BEGIN IMMEDIATE")
        begin = journal.last
        journal.append(event(1))
        journal.flush()
        assert "cannot be written" in journal.error
        assert contacts(journal.since(begin)) == [1]
        other.execute("COMMIT")
        other.close()
        assert until(lambda: not journal.error)
        assert contacts(journal.since(begin)) == [1]


def test_a_file_that_is_removed_or_replaced_is_told(tmp_path: Path) -> None:
    """Everything goes on as before, and nothing of it is there after the next start."""
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        journal.append(event(1))
        journal.flush()
        assert not journal.error
        path.rename(tmp_path / "archive.db")
        assert until(lambda: "j.db has been removed, moved or replaced" in journal.error)  # without an event
        path.write_bytes(b"")
        journal.append(event(2))
        journal.flush()
        assert "j.db has been removed, moved or replaced" in journal.error
        path.unlink()
        (tmp_path / "archive.db").rename(path)
        journal.append(event(3))
        journal.flush()
        assert not journal.error
