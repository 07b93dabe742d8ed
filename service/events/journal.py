"""The journal of events: SQLite in WAL mode. Waiting webhooks, latched collisions
and a lowered speed slider are in the same file.

Events get their number at once and can be read at once. A thread commits them every half second, so that a
killed process loses at most that much. Numbers are reserved in blocks before they are used. Therefore no
number is used twice after a crash, and a reader that asks for the events after the last number it has seen
misses none.
"""

import os
import shutil
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, PositiveFloat

from contactsense.robots.files.file_lock import AVAILABLE, lock
from contactsense.service.events.clock_step import ClockStep
from contactsense.service.events.file_check import FileCheck
from contactsense.service.events.model import ContactEvent
from contactsense.service.events.stored_events import StoredEvents
from contactsense.service.events.tables import SCHEMA

COMMIT_EVERY = 0.5
"""Longest time between an event and its commit [s]."""
_PRUNE_EVERY = 60.0
"""Time between two checks of the limits of age and size [s]."""
_BLOCK = 1000
"""Numbers that are reserved at a time."""
_LARGEST = 2**62
"""Largest number of an event, as a request may have it."""
_MOST_WAITING = 10_000
"""Events that wait in memory while the file cannot be written; beyond it the oldest are lost."""
_REMOVED = 500
"""Events that are removed, or looked at, at a time. Nothing else can use the file meanwhile."""
_PAUSE = 1e-3
"""Time between two such steps, in which others get the file [s]."""
_VACUUM_PAGES = 200
"""Pages that are given back to the file system at a time, for the same reason: 0.8 MB."""
_LEAST_SPACE = 100_000
"""Space on the disk that opening the file takes, with what is beside it [bytes]."""
_WAL_SIZE = 16_000_000
"""Size to which the write-ahead log is cut after a large change [bytes]."""
_RECOVERY = (
    ": while no service runs, move the file away, with the latched collisions in it, or save what can be "
    "read: sqlite3 FILE .recover | sqlite3 NEW"
)
"""What a person can do about a file that is damaged."""


class JournalError(RuntimeError):
    """The journal cannot be opened or read; the message names the file and the reason."""


class JournalSettings(BaseModel):
    """Where events are kept, and how many."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    path: Path | None = None
    """File; None: in memory, only while the service runs."""
    max_age: PositiveFloat = 30.0
    """Older events are removed [days]."""
    max_size: PositiveFloat = 100.0
    """Largest size of the file; beyond it the oldest events are removed [MB]."""
    max_memory: PositiveFloat = 10.0
    """The same where events are in memory only [MB]."""


def _locked(journal: Path, refused: str) -> FileIO:
    """Lock the journal for this service until the returned file is closed.

    With two services in one file, latches would be those of the one that wrote last, numbers would be given
    twice, and webhooks sent twice. The lock is that of a file beside it: SQLite's own would keep readers out.
    """
    try:
        file = FileIO(f"{journal}-lock", "w")
    except OSError as error:
        raise JournalError(f"{refused}: {error.strerror}") from None
    with suppress(OSError):  # a file system without locks
        if AVAILABLE and not lock(file):
            file.close()
            raise JournalError(f"{refused}: another service uses it; each needs a file of its own")
    return file


class Journal:
    """Appends and reads events. Thread-safe."""

    def __init__(self, settings: JournalSettings | None = None) -> None:
        """Open the file, or create it.

        Raises:
            JournalError: The file cannot be used.
        """
        self._settings = settings or JournalSettings()
        place = self._settings.path
        refused = f"{place}: cannot be used as a journal of events"
        self._lock_file = None if place is None else _locked(place, refused)
        try:
            self._database = sqlite3.connect(
                ":memory:" if place is None else place, check_same_thread=False, isolation_level=None
            )
        except sqlite3.Error as error:
            self._release()
            raise JournalError(f"{refused}: {error}") from None
        try:
            self._database.execute("PRAGMA auto_vacuum=INCREMENTAL")
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=NORMAL")
            self._database.execute(f"PRAGMA journal_size_limit={_WAL_SIZE}")
            self._database.executescript(SCHEMA)
            self._file = None if place is None else place.stat()
            self._last = self._reserved = self._first = self._read_last()
            self._reserve(self._last + _BLOCK)
        except (sqlite3.Error, OSError) as error:
            self._database.close()
            self._release()
            is_damaged = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_CORRUPT
            raise JournalError(f"{refused}: {_full(place) or error}{_RECOVERY * is_damaged}") from None
        self.lock = threading.RLock()
        """Must be held while `database` is used, which may take a while; appending does not need it."""
        self._numbering = threading.Lock()
        self._waiting: deque[tuple[int, str, str]] = deque()
        self._clock_step = ClockStep()
        self._subscribers: list[Callable[[ContactEvent], None]] = []
        self._closing = threading.Event()
        # What is wrong, each until it is over.
        self._not_written, self._unreadable, self._not_removed, self._elsewhere = "", "", "", ""
        self._stored = StoredEvents(self.read, place)
        self._writer = threading.Thread(target=self._write, name="event journal", daemon=True)
        self._writer.start()
        self._check = None if place is None else FileCheck(place, self.unreadable, self._stored.note_damaged)

    @property
    def error(self) -> str:
        """What is wrong, such as why the last commit failed, and what follows; empty if nothing is."""
        left_out = self._stored.error
        return self._not_written or self._unreadable or left_out or self._not_removed or self._elsewhere

    @property
    def database(self) -> sqlite3.Connection:
        """The connection, for other tables in the same file; hold `lock` while using it."""
        return self._database

    def read(self, query: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Return the rows of a query of this or another table in the file.

        Raises:
            JournalError: They cannot be read, as the file is damaged there.
        """
        try:
            with self.lock:
                return self._database.execute(query, values).fetchall()
        except sqlite3.Error as error:
            raise self.unreadable(str(error)) from None

    def unreadable(self, why: str) -> JournalError:
        """The error to raise where something in the file cannot be read; `error` says so from now on."""
        self._unreadable = f"{self._settings.path}: the journal cannot be read: {why}{_RECOVERY}"
        return JournalError(self._unreadable)

    @property
    def last(self) -> int:
        """Number of the latest event. Where there has been none, events will have larger numbers."""
        return self._last

    def subscribe(self, on_event: Callable[[ContactEvent], None]) -> Callable[[], None]:
        """Call `on_event` with every appended event, in the appending thread; returns a function that ends
        the subscription."""
        self._subscribers.append(on_event)
        return lambda: self._subscribers.remove(on_event)

    def append(self, event: ContactEvent) -> ContactEvent:
        """Number the event and store it."""
        if self._last >= self._reserved:  # a burst has used up the reserved numbers
            with self.lock:
                self._reserve(self._last + _BLOCK)
        with self._numbering:
            self._last += 1
            numbered = event.model_copy(update={"id": self._last})
            self._waiting.append((self._last, event.kind, numbered.model_dump_json()))
        for on_event in tuple(self._subscribers):
            on_event(numbered)
        return numbered

    def since(self, number: int, limit: int = 500, kinds: Sequence[str] = ()) -> list[str]:
        """Return at most `limit` events after that number as JSON, oldest first, of all or of some kinds.

        A number that has not been given yet belongs to another journal, such as a file that was deleted: all
        events are after it.

        Raises:
            JournalError: Events after it that are no longer in memory cannot be read.
        """
        if number > self._last:
            number = 0
        with self._numbering:  # before the file: an event committed in between is then in both
            waiting = [row for row in self._waiting if row[0] > number and (not kinds or row[1] in kinds)]
            first = self._waiting[0][0] if self._waiting else self._last + 1
        # Readers of new events need no file: one that is damaged must not end their streams.
        rows = self._stored.after(number, limit, kinds) if number + 1 < first else []
        newest = rows[-1][0] if rows else number
        return ([body for _, body in rows] + [row[2] for row in waiting if row[0] > newest])[:limit]

    def latest(self, limit: int, kinds: Sequence[str]) -> list[str]:
        """Return the last `limit` committed events of some kinds as JSON, oldest first.

        Raises:
            JournalError: They cannot be read.
        """
        return self._stored.latest(limit, kinds)

    def flush(self) -> None:
        """Commit the waiting events."""
        with self.lock:
            if self._last > self._reserved - _BLOCK // 2:
                self._reserve(self._last + _BLOCK)
            with self._numbering:
                rows = list(self._waiting)
            if not rows:
                return
            try:
                self._follow_clock()
                now = time.time()
                stored = [(number, kind, now, body) for number, kind, body in rows]
                self._database.execute("BEGIN")
                self._database.executemany("INSERT INTO events VALUES (?, ?, ?, ?)", stored)
                self._database.execute("COMMIT")
            except sqlite3.Error as error:  # such as a full disk: keep the events and try again
                self._not_written = _cannot_write(error)
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")
                self._forget_oldest()
                return
            self._not_written, self._elsewhere = "", self._is_elsewhere()
            with self._numbering:
                for _ in rows:
                    self._waiting.popleft()

    def _forget_oldest(self) -> None:
        """A disk may be full for weeks: what waits for it must not fill the memory."""
        with self._numbering:
            while len(self._waiting) > _MOST_WAITING:
                self._waiting.popleft()

    def _follow_clock(self) -> None:
        """Move the times of this run's events with the host's clock where it was set. A computer that starts
        with a clock that is months slow would lose its events as soon as the clock is right."""
        step = self._clock_step.since_last()
        if step != 0.0:
            self._database.execute("UPDATE events SET stored = stored + ? WHERE id > ?", (step, self._first))

    def prune(self, now: float | None = None) -> None:
        """Remove events beyond the limits of age and size, as far as the end of the service leaves time."""
        settings = self._settings
        oldest = (time.time() if now is None else now) - 86400.0 * settings.max_age
        most = settings.max_memory if settings.path is None else settings.max_size
        with self.lock:
            self._follow_clock()
        seen: int | None = 0
        while seen is not None and not self._closing.wait(_PAUSE):
            seen = self._remove_older(oldest, seen)
        while not self._closing.wait(_PAUSE) and self._remove_first(1e6 * most):
            pass
        while not self._closing.wait(_PAUSE) and self._give_back():
            pass

    def _remove_older(self, oldest: float, after: int) -> int | None:
        """Remove what was stored before `oldest` from the next events after the number `after`; returns the
        number of the last of them, None if there are none."""
        with self.lock:
            (last,) = self._database.execute(
                "SELECT max(id) FROM (SELECT id FROM events WHERE id > ? ORDER BY id LIMIT ?)",
                (after, _REMOVED),
            ).fetchone()
            self._database.execute(
                "DELETE FROM events WHERE id > ? AND id <= ? AND stored < ?", (after, last, oldest)
            )
        return None if last is None else int(last)

    def _remove_first(self, most: float) -> bool:
        """Remove the first events if all are larger than `most` [bytes]; returns whether there were any."""
        with self.lock:
            if self._size() <= most:
                return False
            first = "SELECT id FROM events ORDER BY id LIMIT ?"
            removed = self._database.execute(f"DELETE FROM events WHERE id IN ({first})", (_REMOVED,))
            return removed.rowcount > 0

    def _give_back(self) -> bool:
        """Give free pages back to the file system; returns whether there were any."""
        with self.lock:
            free = self._pages("freelist_count")
            # `execute` steps once, which gives back a single page.
            self._database.executescript(f"PRAGMA incremental_vacuum({_VACUUM_PAGES})")
            return self._pages("freelist_count") < free

    def close(self) -> None:
        """Commit and close."""
        self._closing.set()
        self._writer.join(5.0)
        if self._check is not None:
            self._check.close()
        with self.lock:
            self.flush()
            self._reserve(self._last)
            self._database.close()
            self._release()

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _release(self) -> None:
        if self._lock_file is not None:
            self._lock_file.close()

    def _size(self) -> int:
        free, used = self._pages("freelist_count"), self._pages("page_count")
        return (used - free) * self._pages("page_size")

    def _pages(self, name: str) -> int:
        return int(self._database.execute(f"PRAGMA {name}").fetchone()[0])

    def _read_last(self) -> int:
        row = self._database.execute(
            "SELECT value FROM numbers WHERE name = 'reserved' AND typeof(value) = 'integer' "
            "AND value BETWEEN 0 AND ?",
            (_LARGEST,),
        ).fetchone()
        (highest,) = self._database.execute("SELECT max(id) FROM events").fetchone()
        if row is None:
            # Numbers must rise, too, where another journal was used before, or where this one is damaged.
            return max(time.time_ns() // 1_000_000, highest or 0)
        return max(int(row[0]), highest or 0)

    def _reserve(self, upto: int) -> None:
        try:
            self._database.execute("INSERT OR REPLACE INTO numbers VALUES ('reserved', ?)", (upto,))
            self._reserved = upto
        except sqlite3.Error as error:
            self._not_written = _cannot_write(error)

    def _write(self) -> None:
        prune_at = time.monotonic() + _PRUNE_EVERY
        while not self._closing.wait(COMMIT_EVERY):
            self.flush()
            if time.monotonic() > prune_at:
                prune_at = time.monotonic() + _PRUNE_EVERY
                try:
                    self.prune()
                    self._not_removed = ""
                except sqlite3.Error as error:
                    self._not_removed = f"old events cannot be removed from the journal: {error}"
            self._elsewhere = self._is_elsewhere()
            with suppress(JournalError):
                self._stored.look_again()

    def _is_elsewhere(self) -> str:
        """What is wrong if somebody has removed, moved or replaced the file: what is written goes to one
        without a name, and the next service does not find it."""
        place = self._settings.path
        if place is None or self._file is None:
            return ""
        with suppress(OSError):
            if os.path.samestat(place.stat(), self._file):
                return ""
        return (
            f"{place} has been removed, moved or replaced: events, latched collisions and waiting webhooks "
            "are lost when the service ends; start it again"
        )


def _full(place: Path | None) -> str:
    """What is wrong if the file's disk is full, for which SQLite has other words, such as "disk I/O error";
    empty if it is not."""
    with suppress(OSError):
        if place is not None and shutil.disk_usage(place.parent).free < _LEAST_SPACE:
            return "the disk is full"
    return ""


def _cannot_write(error: Exception) -> str:
    return f"the journal cannot be written: {error}: events are in memory only; is the disk full?"
