"""Stores latched collisions and a lowered speed slider in the journal's file, so that they survive a restart
or crash of the service."""

import json
import logging
import sqlite3
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from contactsense.service.events.journal import Journal

log = logging.getLogger("contactsense")


class ReactionStore:
    """Stores the decisions that began the latched collisions, one for each rule, and the slider's fraction.

    Args:
        journal: The journal whose file is used.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        # One thread: keeps the order of writes, and callers do not wait for the file.
        self._writer = ThreadPoolExecutor(1, "reactions")

    def load(self) -> list[dict[str, Any]]:
        """Return the decisions that were latched when the service last ran, in the form of
        `Decision.as_dict`."""
        with self._journal.lock:
            rows = self._journal.database.execute("SELECT body FROM latches ORDER BY rowid").fetchall()
        return [json.loads(body) for (body,) in rows]

    def load_lowered(self) -> float | None:
        """Return the fraction to which the speed slider was lowered when the service last ran; None: it was
        not."""
        with self._journal.lock:
            row = self._journal.database.execute("SELECT fraction FROM lowered").fetchone()
        return None if row is None else float(row[0])

    def save(self, decisions: Sequence[dict[str, Any]]) -> None:
        """Replace the stored decisions by these; returns at once."""
        rows = [(found["rule"], json.dumps(found)) for found in decisions]
        self._writer.submit(self._write, "latches", "VALUES (?, ?)", rows)

    def save_lowered(self, fraction: float | None) -> None:
        """Replace the stored fraction by this one; returns at once."""
        rows = [] if fraction is None else [(fraction,)]
        self._writer.submit(self._write, "lowered", "VALUES (?)", rows)

    def close(self) -> None:
        """Wait until everything is written."""
        self._writer.shutdown()

    def _write(self, table: str, values: str, rows: Sequence[tuple[Any, ...]]) -> None:
        database = self._journal.database
        with self._journal.lock:
            try:
                database.execute("BEGIN")
                database.execute(f"DELETE FROM {table}")
                database.executemany(f"INSERT OR REPLACE INTO {table} {values}", rows)
                database.execute("COMMIT")
            except sqlite3.Error as error:
                if database.in_transaction:
                    database.execute("ROLLBACK")
                log.error("the state of the reactions cannot be written to the journal: %s", error)
