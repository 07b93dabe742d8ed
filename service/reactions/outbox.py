"""The outbox of webhooks: tables in the journal's file. Where one is damaged, a table in memory goes on with
what can be read: later deliveries must not wait until a person has repaired the file."""

import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from contactsense.service.events.journal import Journal

_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_IOERR_READ)
"""Errors of a damaged page, and of a disk that does not give it back. A full disk has others."""
_LARGEST = 2**63 - 1
"""Largest number of a row."""


class Outbox:
    """Runs statements on the tables of the outbox."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._in_memory: set[str] = set()
        """Tables that are damaged in the file."""
        self.error = ""
        """What is damaged, and what follows; empty if nothing is."""

    def run(self, table: str, statement: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Run a statement on a table and return its rows.

        Raises:
            sqlite3.Error: It cannot be run, as on a full disk.
        """
        with self._journal.lock:
            try:
                return self._journal.database.execute(statement, values).fetchall()
            except sqlite3.Error as error:
                code = getattr(error, "sqlite_errorcode", None)  # the module's own errors have none
                if code not in _DAMAGED or table in self._in_memory:
                    raise
                self._go_on_in_memory(table, str(error))
                return self._journal.database.execute(statement, values).fetchall()

    def drop(self, number: int) -> None:
        """Remove a delivery.

        Raises:
            sqlite3.Error: It cannot be removed now.
        """
        with self._journal.lock:
            self.run("deliveries", "DELETE FROM deliveries WHERE id = ?", (number,))
            if "deliveries" in self._in_memory:  # what is left there is sent again after a start
                with suppress(sqlite3.Error):
                    self._journal.database.execute("DELETE FROM main.deliveries WHERE id = ?", (number,))

    def _go_on_in_memory(self, table: str, why: str) -> None:
        """Create a temporary table with the rows that can be read: its name hides the one in the file. A new
        one in the file would move pages that are damaged."""
        rows, database = self._readable(table), self._journal.database
        database.execute("PRAGMA temp_store=MEMORY")
        ((sql,),) = database.execute(
            "SELECT sql FROM main.sqlite_schema WHERE type = 'table' AND name = ?", (table,)
        )
        database.execute(sql.replace("CREATE TABLE", "CREATE TEMP TABLE", 1))
        for row in rows:
            marks = ", ".join("?" * len(row))
            database.execute(f"INSERT OR IGNORE INTO {table} VALUES ({marks})", row)
        # A later delivery must not get the number of one that cannot be read: an attempt may be under way.
        last = database.execute("SELECT seq FROM main.sqlite_sequence WHERE name = ?", (table,)).fetchall()
        for (number,) in last:
            database.execute("DELETE FROM temp.sqlite_sequence WHERE name = ?", (table,))
            database.execute("INSERT INTO temp.sqlite_sequence VALUES (?, ?)", (table, number))
        self._in_memory.add(table)
        self._journal.unreadable(why)
        told = f"{len(rows)} rows of the journal's damaged table {table} could be read"
        self.error += f"{'; ' * bool(self.error)}{told}; they and later ones are in memory only"

    def _readable(self, table: str) -> list[tuple[Any, ...]]:
        """The rows before and after what is damaged."""
        rows: dict[int, tuple[Any, ...]] = {}
        for after, first, order in ((">", -1, "ASC"), ("<", _LARGEST, "DESC")):
            # One by one: sqlite3 reads a row ahead, and would lose that before the damage.
            one = f"SELECT rowid, * FROM {table} WHERE rowid {after} ? ORDER BY rowid {order} LIMIT 1"
            number = first
            with suppress(sqlite3.Error):
                while found := self._journal.database.execute(one, (number,)).fetchall():
                    number = found[0][0]
                    rows[number] = found[0][1:]
        return list(rows.values())
