"""Stores latched collisions in the journal's file, so that they survive a restart or crash of the service."""

import json
import logging
import sqlite3
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from contactsense.service.events.journal import Journal

log = logging.getLogger("contactsense")


class LatchStore:
    """Stores the decisions that began the latched collisions, one for each rule.

    Args:
        journal: The journal whose file is used.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        # One thread: keeps the order of writes, and callers do not wait for the file.
        self._writer = ThreadPoolExecutor(1, "latches")

    def load(self) -> list[dict[str, Any]]:
        """Return the decisions that were latched when the service last ran, in the form of
        `Decision.as_dict`."""
        with self._journal.lock:
            rows = self._journal.database.execute("SELECT body FROM latches ORDER BY rowid").fetchall()
        return [json.loads(body) for (body,) in rows]

    def save(self, decisions: Sequence[dict[str, Any]]) -> None:
        """Replace the stored decisions by these; returns at once."""
        self._writer.submit(self._write, [(found["rule"], json.dumps(found)) for found in decisions])

    def close(self) -> None:
        """Wait until everything is written."""
        self._writer.shutdown()

    def _write(self, rows: list[tuple[str, str]]) -> None:
        database = self._journal.database
        with self._journal.lock:
            try:
                database.execute("BEGIN")
                database.execute("DELETE FROM latches")
                database.executemany("INSERT OR REPLACE INTO latches VALUES (?, ?)", rows)
                database.execute("COMMIT")
            except sqlite3.Error as error:
                if database.in_transaction:
                    database.execute("ROLLBACK")
                log.error("latched collisions cannot be written to the journal: %s", error)
