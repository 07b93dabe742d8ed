"""A check of the journal's whole file, so that damage is known before somebody needs what is damaged."""

import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

_PAUSE = 1.0
"""Time before the check begins [s]: a journal may be opened for a moment only, to try whether it can be."""
_STEPS = 1000
"""Instructions of SQLite between two looks at whether to end."""
_DAMAGED = "SELECT id FROM events WHERE NOT json_valid(body)"
"""SQLite's own check compares no texts with what they were."""
_TOLD = (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CORRUPT)
"""Errors that are damage."""


class FileCheck:
    """Reads the file of a database once, in a thread of its own: with a slow disk this takes seconds.

    Args:
        path: The file.
        on_damage: Called from the thread if something in the file is damaged or cannot be read, with what
            SQLite calls it.
        on_damaged_event: Called from the thread with the number of each event whose text is damaged.
    """

    def __init__(
        self, path: Path, on_damage: Callable[[str], object], on_damaged_event: Callable[[int], object]
    ) -> None:
        self._path, self._on_damage, self._on_damaged_event = path, on_damage, on_damaged_event
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._check, name="journal check", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End: as long as this connection is open, SQLite's files beside the database stay."""
        self._ending.set()
        self._thread.join(5.0)

    def _check(self) -> None:
        if self._ending.wait(_PAUSE):
            return
        place = f"{self._path.absolute().as_uri()}?mode=ro"
        try:
            with closing(sqlite3.connect(place, uri=True)) as database:
                database.set_progress_handler(self._ending.is_set, _STEPS)
                # First, as it can be ended: a slow disk takes seconds. The pages are then in memory.
                damaged = database.execute(_DAMAGED).fetchall()
                (found,) = database.execute("PRAGMA quick_check(1)").fetchone()
        except sqlite3.Error as error:
            # Else it has been ended, or the file has just been removed, which the journal notices itself.
            if error.sqlite_errorcode & 0xFF in _TOLD:
                self._on_damage(str(error))
            return
        if found != "ok":
            self._on_damage("database disk image is malformed")
        for (number,) in damaged:
            self._on_damaged_event(number)
