"""Reads the events in the journal's file. Of its pages SQLite notices damage, of the texts in them it does
not: a disk or a memory that has changed a byte must not keep the other events from their readers."""

import json
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

_NAMED = 10
"""Damaged events that a message names."""
Read = Callable[[str, Sequence[object]], list[tuple[Any, ...]]]


class StoredEvents:
    """The events of the file that are intact.

    Args:
        read: Runs a query and returns its rows.
        place: The file; None: there is none.
    """

    def __init__(self, read: Read, place: Path | None) -> None:
        self._read, self._place = read, place
        self._damaged: set[int] = set()
        self._lock = threading.Lock()

    @property
    def error(self) -> str:
        """Which events are left out, as their texts are damaged, and how to remove them; empty if none."""
        with self._lock:
            numbers = sorted(self._damaged)
        if not numbers:
            return ""
        named, more = ", ".join(map(str, numbers[:_NAMED])), len(numbers) - _NAMED
        is_one = len(numbers) == 1
        others = f" and {more} more" if more > 0 else ""
        which = f"event {named} is" if is_one else f"events {named}{others} are"
        removed = "it" if is_one else f"the first {_NAMED}" if others else "them"
        return (
            f"{self._place}: {which} damaged and left out: does the disk fail? While no service runs, "
            f"sqlite3 {self._place} 'DELETE FROM events WHERE id IN ({named})' removes {removed}"
        )

    def note_damaged(self, number: int) -> None:
        """Take note of an event that is left out, as its text is damaged."""
        with self._lock:
            self._damaged.add(number)

    def look_again(self) -> None:
        """Forget those of the named events that have been removed or repaired since.

        Raises:
            JournalError: They cannot be read.
        """
        with self._lock:
            numbers = sorted(self._damaged)[:_NAMED]
        if numbers:
            query = f"SELECT id, CAST(body AS BLOB) FROM events WHERE id IN ({_marks(numbers)})"
            rows = self._read(query, numbers)
            intact = {number for number, _ in self._intact(rows)}
            removed = set(numbers) - {number for number, _ in rows}
            with self._lock:
                self._damaged -= intact | removed

    def after(self, number: int, limit: int, kinds: Sequence[str] = ()) -> list[tuple[int, str]]:
        """Numbers and JSON of at most `limit` events after that number, oldest first, of all or of some
        kinds. Fewer are all that there are."""
        of_kinds = f"AND kind IN ({_marks(kinds)})" if kinds else ""
        query = f"SELECT id, CAST(body AS BLOB) FROM events WHERE id > ? {of_kinds} ORDER BY id LIMIT ?"
        found: list[tuple[int, str]] = []
        while len(found) < limit:
            rows = self._read(query, (number, *kinds, limit - len(found)))
            if not rows:
                break
            found += self._intact(rows)
            number = rows[-1][0]
        return found

    def latest(self, limit: int, kinds: Sequence[str]) -> list[str]:
        """JSON of the intact ones of the last `limit` events of some kinds, oldest first."""
        query = (
            f"SELECT id, CAST(body AS BLOB) FROM events WHERE kind IN ({_marks(kinds)}) "
            "ORDER BY id DESC LIMIT ?"
        )
        return [body for _, body in reversed(self._intact(self._read(query, (*kinds, limit))))]

    def _intact(self, rows: Sequence[tuple[int, bytes]]) -> list[tuple[int, str]]:
        found = []
        for number, stored in rows:
            try:
                body = stored.decode()
                if json.loads(body)["id"] != number:
                    raise ValueError(f"expected event {number}")
                found.append((number, body))
            except (ValueError, TypeError, LookupError):
                self.note_damaged(number)
        return found


def _marks(values: Sequence[object]) -> str:
    return ",".join("?" * len(values))
