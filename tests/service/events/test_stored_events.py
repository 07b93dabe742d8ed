"""Events in a file of which a disk, or a memory, has changed a byte within a text: SQLite notices nothing."""

import re
import sqlite3
import threading
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.events import file_check
from contactsense.service.events.file_check import FileCheck
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.events.open_contacts import OpenContacts
from tests.service.events.test_journal import contacts, event
from tests.service.loopback import until

DAMAGE = [
    pytest.param(b'"contact":3', b'"contact";3', id="no JSON"),
    pytest.param(b'"contact":3', b'"contact\xff:3', id="no UTF-8"),
    pytest.param(b'{"id"', b'{"if"', id="no number"),
]


def changed(folder: Path, before: bytes, after: bytes) -> tuple[Path, int]:
    """A file with five events, and the number of the one in which a byte is another one."""
    path = folder / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        numbers = [journal.append(event(n)).id for n in range(5)]
    content = path.read_bytes()
    begin = content.index(b'{"id":%d,' % numbers[3])
    assert before in content[begin : begin + 50]
    path.write_bytes(content[:begin] + content[begin:].replace(before, after, 1))
    with closing(sqlite3.connect(path)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    return path, numbers[3]


@pytest.mark.parametrize(("before", "after"), DAMAGE)
def test_the_others_are_read_and_it_is_told(before: bytes, after: bytes, tmp_path: Path) -> None:
    path, number = changed(tmp_path, before, after)
    with Journal(JournalSettings(path=path)) as journal:
        assert contacts(journal.since(0)) == [0, 1, 2, 4]
        assert re.match(rf".*j\.db: event {number} is damaged and left out: does the disk", journal.error)
        # Whoever asks for one after the other does not take it for the end.
        assert contacts(journal.since(number - 1, limit=1)) == [4]
        assert contacts(journal.since(0, kinds=("onset",))) == [0, 1, 2, 4]
        left_open = OpenContacts(journal).end("the service", "")
        assert [each.contact for each in left_open] == [0, 1, 2, 4]
        with closing(sqlite3.connect(path)) as database:  # what it advises
            advised = re.search("'(DELETE .*)'", journal.error)
            assert advised is not None
            database.execute(advised[1])
            database.commit()
    with Journal(JournalSettings(path=path)) as journal:
        assert contacts(journal.since(0)) == [0, 1, 2, 4]
        assert not journal.error


def test_what_is_told_follows_what_is_removed_and_repaired(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was told until the service ended. All that are damaged are told at once."""
    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        first, *_, last = (journal.append(event(n)).id for n in range(15))
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("CREATE TABLE intact AS SELECT id, body FROM events")
        database.execute("UPDATE events SET body = 'x' WHERE id < ?", (last,))
        with Journal(JournalSettings(path=path)) as journal:
            assert until(lambda: f"events {first}, {first + 1}, " in journal.error)
            assert f", {first + 9} and 4 more are damaged" in journal.error
            assert journal.error.endswith("removes the first 10")
            advised = re.search("'(DELETE .*)'", journal.error)
            assert advised is not None
            database.execute(advised[1])
            assert until(lambda: f"events {first + 10}, {first + 11}, " in journal.error)
            assert journal.error.endswith("removes them")
            database.execute(
                "UPDATE events SET body = (SELECT body FROM intact WHERE intact.id = events.id) WHERE id > ?",
                (first + 10,),
            )
            assert until(lambda: f"event {first + 10} is damaged" in journal.error)
            assert journal.error.endswith("removes it")
            database.execute("DELETE FROM events WHERE body = 'x'")
            assert until(lambda: not journal.error)
            assert contacts(journal.since(0)) == [11, 12, 13, 14]


@pytest.mark.parametrize("value", ["'x'", "CAST(x'ff' AS TEXT)", "-7", "9223372036854775807"])
def test_numbers_rise_though_what_was_reserved_is_damaged(value: str, tmp_path: Path) -> None:
    """The service did not start."""
    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        before = journal.append(event(1)).id
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"UPDATE numbers SET value = {value}")
        database.commit()
    for n in (2, 3):  # also after a further start
        with Journal(JournalSettings(path=path)) as journal:
            assert contacts(journal.since(before - 1)) == list(range(1, n))
            assert journal.append(event(n)).id > before
            assert not journal.error


def test_it_is_told_soon_after_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    path, number = changed(tmp_path, b'"contact":3', b'"contact";3')
    with Journal(JournalSettings(path=path)) as journal:
        assert until(lambda: f"event {number} is damaged" in journal.error)


def test_the_check_of_a_large_file_ends_with_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slow disk takes seconds for it. SQLite's own check, which cannot be ended, comes last."""
    statements: list[str] = []
    texts: list[str] = []
    begun = threading.Event()

    class Slow(sqlite3.Connection):
        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            self.set_trace_callback(statements.append)
            self.create_function("json_valid", 1, self.read)

        def read(self, text: str) -> bool:
            texts.append(text)
            begun.set()
            return check._ending.wait(60.0)

    path = tmp_path / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        for n in range(3000):
            journal.append(event(n))
    monkeypatch.setattr(file_check, "_PAUSE", 0.0)
    monkeypatch.setattr(sqlite3, "connect", partial(sqlite3.connect, factory=Slow))
    told: list[object] = []
    check = FileCheck(path, told.append, told.append)
    assert begun.wait(20.0)
    check.close()
    check._thread.join(20.0)
    assert 0 < len(texts) < 3000
    assert not any("quick_check" in statement for statement in statements)
    assert told == []
