"""Stores latched collisions and a lowered speed slider in the journal's file, so that they survive a restart
or crash of the service."""

import json
import logging
import sqlite3
import threading
from collections.abc import Sequence
from typing import Any

from pydantic import TypeAdapter, ValidationError

from contactsense.service.events.journal import Journal
from contactsense.service.reactions.decision import Decision

_AGAIN = 1.0
"""Time before another attempt to write what could not be written [s]."""
_DECISION = TypeAdapter(Decision)
log = logging.getLogger("contactsense")


class ReactionStore:
    """Stores the decisions that began the latched collisions, one for each rule, and the slider's fraction.

    Args:
        journal: The journal whose file is used.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._news = threading.Condition()
        self._unsaved: dict[str, tuple[str, list[tuple[Any, ...]]]] = {}
        """Table -> the placeholders of a row, and the rows that are to replace those of the table."""
        self._closing = False
        self._failing = False
        # One thread: keeps the order of writes, and callers do not wait for the file.
        self._writer = threading.Thread(target=self._run, name="reactions", daemon=True)
        self._writer.start()

    def load(self) -> list[dict[str, Any]]:
        """Return the decisions that were latched when the service last ran, in the form of
        `Decision.as_dict`.

        Raises:
            JournalError: They cannot be read, so that nobody knows whether a collision is latched.
        """
        found = []
        for rule, body in self._journal.read("SELECT rule, body FROM latches ORDER BY rowid"):
            try:  # fields of a later version are left out
                found.append(_DECISION.dump_python(_DECISION.validate_json(body), mode="json"))
            except ValidationError as error:
                wrong = f"latched collision of rule {rule}: {error.errors()[0]['msg']}"
                raise self._journal.unreadable(wrong) from None
        return found

    def load_lowered(self) -> float | None:
        """Return the fraction to which the speed slider was lowered when the service last ran; None: it was
        not.

        Raises:
            JournalError: It cannot be read.
        """
        rows = self._journal.read("SELECT fraction FROM lowered")
        try:
            return float(rows[0][0]) if rows else None
        except ValueError:  # SQLite keeps a text where a number is expected
            raise self._journal.unreadable(f"lowered speed slider: {rows[0][0]!r:.40}") from None

    def save(self, decisions: Sequence[dict[str, Any]]) -> None:
        """Replace the stored decisions by these; returns at once. While the file cannot be written, as on a
        full disk, it is tried again."""
        self._replace("latches", "(?, ?)", [(found["rule"], json.dumps(found)) for found in decisions])

    def save_lowered(self, fraction: float | None) -> None:
        """Replace the stored fraction by this one, as `save` does."""
        self._replace("lowered", "(?)", [] if fraction is None else [(fraction,)])

    def close(self) -> None:
        """Wait until everything is written, or cannot be."""
        with self._news:
            self._closing = True
            self._news.notify()
        self._writer.join()

    def _replace(self, table: str, row: str, rows: list[tuple[Any, ...]]) -> None:
        with self._news:
            self._unsaved[table] = row, rows
            self._news.notify()

    def _run(self) -> None:
        """Main loop of the thread that writes."""
        while True:
            with self._news:
                self._news.wait_for(lambda: self._unsaved or self._closing)
                taken, self._unsaved = self._unsaved, {}
                closing = self._closing
            left = {table: what for table, what in taken.items() if not self._write(table, *what)}
            with self._news:
                self._unsaved = {**left, **self._unsaved}  # what has come meanwhile is newer
                if closing:
                    return
                if left:
                    self._news.wait_for(lambda: self._closing, _AGAIN)

    def _write(self, table: str, row: str, rows: list[tuple[Any, ...]]) -> bool:
        """Replace the rows of a table; returns False if that is not possible now."""
        database = self._journal.database
        with self._journal.lock:
            try:
                database.execute("BEGIN")
                database.execute(f"DELETE FROM {table}")
                database.executemany(f"INSERT OR REPLACE INTO {table} VALUES {row}", rows)
                database.execute("COMMIT")
            except sqlite3.Error as error:
                if database.in_transaction:
                    database.execute("ROLLBACK")
                if not self._failing:
                    log.error(
                        "the state of the reactions cannot be written to the journal, and is tried again: %s",
                        error,
                    )
                self._failing = True
                return False
        if self._failing:
            log.info("the state of the reactions is in the journal again")
        self._failing = False
        return True
