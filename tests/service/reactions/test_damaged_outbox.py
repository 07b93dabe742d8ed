"""The outbox goes on where the disk has damaged a page of its tables."""

import sqlite3
from pathlib import Path

import pytest

from contactsense.service.events.journal import Journal, JournalSettings
from tests.service.reactions.webhook_receivers import deliver, hook, receiver, stored, waiting

_PAGE = 4096
_STORED = 100


def damaged_outbox(folder: Path, what: str) -> tuple[Path, int]:
    """A journal with waiting deliveries in whose file a page was overwritten, as by a failing disk, and the
    number of deliveries in that page.

    Args:
        folder: Where it is created.
        what: The root page of this table or index, or `page` for one in the midst of the deliveries.
    """
    path = folder / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        stored(journal, _STORED)
    content = bytearray(path.read_bytes())
    if what == "page":
        begins = range(0, len(content), _PAGE)
        pages = [begin for begin in begins if b"msg_" in content[begin : begin + _PAGE]]
        begin = pages[len(pages) // 2]
    else:
        database = sqlite3.connect(path)
        ((root,),) = database.execute("SELECT rootpage FROM sqlite_schema WHERE name = ?", (what,))
        database.close()
        begin = (root - 1) * _PAGE
    lost = _STORED if what == "deliveries" else content[begin : begin + _PAGE].count(b"msg_")
    content[begin : begin + _PAGE] = _PAGE * b"\xa5"
    path.write_bytes(content)
    return path, lost


@pytest.mark.parametrize("what", ["page", "deliveries", "disabled", "sqlite_autoindex_disabled_1"])
def test_what_can_be_read_and_what_comes_later_is_delivered(tmp_path: Path, what: str) -> None:
    path, lost = damaged_outbox(tmp_path, what)
    with receiver(204) as server, Journal(JournalSettings(path=path)) as journal:
        expected = _STORED - lost + 3
        # An empty table is not read: its index says that there is nothing.
        error = "" if what == "disabled" else r"\d+ rows of .* in memory only"
        told = deliver(journal, hook(server.server_port), 3, lambda _, told: len(told) == expected, error)
        assert told == [(True, "answered 204")] * expected
        assert waiting(journal) == 0
        if error:
            assert "j.db: the journal cannot be read: database disk image is malformed: " in journal.error


def test_most_of_what_was_delivered_is_not_sent_again_after_a_start(tmp_path: Path) -> None:
    """SQLite cannot remove all that is beside the damaged page; receivers know them by their identifiers."""
    path, lost = damaged_outbox(tmp_path, "page")
    for most in (_STORED - lost, 2 * lost):
        with receiver(204) as server, Journal(JournalSettings(path=path)) as journal:
            deliver(journal, hook(server.server_port), 0, lambda *_, kept=journal: waiting(kept) == 0, ".+")
            assert 0 < len(server.heard) <= most


def test_a_delivery_does_not_get_the_number_of_one_that_cannot_be_read(tmp_path: Path) -> None:
    """An attempt to deliver that one may be under way."""
    path, _ = damaged_outbox(tmp_path, "deliveries")
    with Journal(JournalSettings(path=path)) as journal:
        stored(journal, 1)
        assert journal.database.execute("SELECT id FROM deliveries").fetchall() == [(_STORED + 1,)]
