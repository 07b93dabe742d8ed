"""Reads the events in the journal's file. Of its pages SQLite notices damage, of the texts in them it does
not: a disk or a memory that has changed a byte must not keep the other events from their readers."""

import json
from collections.abc import Callable, Sequence
from typing import Any

Read = Callable[[str, Sequence[object]], list[tuple[Any, ...]]]


class StoredEvents:
    """The events of the file that are intact.

    Args:
        read: Runs a query and returns its rows.
        on_damage: Called with the number of an event that is left out, as its text is damaged.
    """

    def __init__(self, read: Read, on_damage: Callable[[int], object]) -> None:
        self._read, self._on_damage = read, on_damage

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
                self._on_damage(number)
        return found


def _marks(values: Sequence[object]) -> str:
    return ",".join("?" * len(values))
