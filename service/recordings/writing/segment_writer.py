"""Writing tables to disk: Arrow IPC streams while rows arrive, Parquet when a segment is complete.

An Arrow stream is readable up to its last complete batch, whatever happens to the writer. A segment is closed
when it reaches a given size or duration. One thread writes the streams and another one converts closed
segments to Parquet: a busy disk holds up a write for seconds, during which a thread that reads sensors would
lose readings. Both are scheduled normally where that thread runs in real time. Unfinished files of a killed
writer are converted to Parquet at the next start; those of a writer that still runs are locked and left
alone. So are those that cannot be read, which is told.
"""

import errno
import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.robots.files.file_lock import AVAILABLE, lock
from contactsense.service.live.scheduling import deprioritize
from contactsense.service.recordings.metadata import creation
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.recordings.tables.table import reason
from contactsense.service.recordings.writing.oldest_files import OldestFiles

_LOG = logging.getLogger("contactsense")
OPEN, DONE, PARTIAL = ".arrows", ".parquet", ".parquet.part"
ROW_GROUP_SECONDS = 60.0
"""Length of a row group of the Parquet files [s]."""
_GROUP = 30_000
"""Rows of such a group where their rate is not known."""
_STAYS = "it stays as it is, and the next start in its folder tries again"
_MOST_BATCHES = 100
"""Number of batches that may wait for the disk before the thread that adds rows waits, too."""


@dataclass(frozen=True, slots=True)
class Rotation:
    """When a segment is closed, and how much disk space the segments may use."""

    seconds: float = 600.0
    """Maximum duration of a segment [s]."""
    megabytes: float = 256.0
    """Maximum size of a segment before compression [MB]."""
    disk_megabytes: float | None = None
    """Maximum total size of the complete segments [MB]; the oldest are removed. None: no limit."""


class SegmentWriter:
    """Writes one table, row by row.

    Args:
        folder: Destination of the files; it is created.
        prefix: Prefix of the file names; unique per table in the folder.
        names: Columns, all float64.
        meta: Metadata of the schema; each file has the time at which it began, too.
        rotation: When a segment is closed.
        flush_seconds: Maximum time that rows wait in memory [s].
        rate: Expected rate of rows [Hz]; determines the buffer size.
        warn: Told what goes wrong with earlier files, while later ones are written all the same.

    Raises:
        RecordingError: The folder cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        prefix: str,
        names: Sequence[str],
        meta: dict[str, str],
        rotation: Rotation | None = None,
        *,
        flush_seconds: float = 0.5,
        rate: float = 500.0,
        warn: Callable[[str], None] = _LOG.warning,
    ) -> None:
        self._folder, self._prefix = folder, prefix
        self._rotation = rotation or Rotation()
        self._meta = meta
        self._schema = pa.schema([(name, pa.float64()) for name in names])
        self._rows = np.zeros((max(16, int(4.0 * rate * flush_seconds)), len(names)))
        self._filled = 0
        self._flush_seconds = flush_seconds
        self._group = max(1, round(rate * ROW_GROUP_SECONDS))
        self._due = 0.0
        self._number = 0
        self._sink: pa.OSFile | None = None
        self._stream: pa.RecordBatchStreamWriter | None = None
        self._path = folder
        self._lock: IO[bytes] | None = None
        self._opened, self._bytes = 0.0, 0
        self._writer = ThreadPoolExecutor(1, "segments", deprioritize)
        self._writing: deque[Future[None]] = deque()
        self._completer = ThreadPoolExecutor(1, "completed-segments", deprioritize)
        self._completing: deque[Future[None]] = deque()
        self.rows = 0
        """Number of rows added so far."""
        self.files: list[Path] = []
        """Complete files, in order; a thread changes it."""
        limit = self._rotation.disk_megabytes
        self._oldest = None if limit is None else OldestFiles(folder, prefix, int(1e6 * limit), warn)
        self._warn = warn
        self.removed = 0
        """Number of files that were removed to keep the limit of the disk space, also of earlier runs."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.repaired = repair(folder, prefix, warn)
            """Unfinished files of an earlier run that were repaired."""
        except OSError as error:
            raise RecordingError(f"{folder}: cannot write: {reason(error)}") from None

    def add(self, row: Sequence[float] | np.ndarray) -> None:
        """Add one row; values in the order of the columns.

        Does not wait for the disk, unless it has fallen far behind.

        Raises:
            RecordingError: An earlier row could not be written: the disk is full, or folder or file are gone.
        """
        self._rows[self._filled] = row
        self._filled += 1
        self.rows += 1
        now = time.monotonic()
        if self._filled == len(self._rows) or now >= self._due:
            self._hand_over()
            self._due = now + self._flush_seconds

    def flush(self) -> None:
        """Pass all rows to the operating system; from then on they survive the end of this process.

        Raises:
            RecordingError: The disk is full, or the folder is gone.
        """
        self._hand_over()
        self._wait(self._writing)

    def close(self) -> list[Path]:
        """Complete all segments and return the files of this run, without those that were removed.

        Raises:
            RecordingError: The disk is full, or the folder is gone.
        """
        try:
            self.flush()
            self._writing.append(self._writer.submit(self._finish))
            self._wait(self._writing)
            self._wait(self._completing)
        finally:
            self._writer.shutdown()
            self._completer.shutdown()
            if self._lock is not None:
                self._lock.close()
        return self.files

    def _hand_over(self) -> None:
        """Give the rows to the thread that writes."""
        if self._filled:
            self._writing.append(self._writer.submit(self._write, self._rows[: self._filled].copy()))
            self._filled = 0
        self._wait(self._writing, _MOST_BATCHES)
        self._wait(self._completing, _MOST_BATCHES)

    def _wait(self, tasks: deque[Future[None]], most: int = 0) -> None:
        """Wait until at most that many tasks are unfinished, and raise the errors of the finished ones."""
        try:
            while tasks and (len(tasks) > most or tasks[0].done()):
                tasks.popleft().result()
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot write: {reason(error)}") from None

    def _write(self, rows: np.ndarray) -> None:
        if self._stream is None:
            self._open()
        assert self._stream is not None
        assert self._sink is not None
        arrays = [pa.array(np.ascontiguousarray(column)) for column in rows.T]
        self._stream.write_batch(pa.record_batch(arrays, schema=self._schema))
        self._sink.flush()
        if not self._path.exists():  # writing to a file without a name succeeds
            raise FileNotFoundError(errno.ENOENT, "somebody has removed or moved it")
        self._bytes += rows.nbytes
        if (
            self._bytes >= 1e6 * self._rotation.megabytes
            or time.monotonic() - self._opened >= self._rotation.seconds
        ):
            self._finish()

    def _open(self) -> None:
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
        while True:
            self._path = self._folder / f"{self._prefix}-{stamp}-{self._number:04d}{OPEN}"
            self._number += 1
            if self._path.with_suffix(DONE).exists():
                continue
            with suppress(FileExistsError):
                self._lock = self._path.open("xb")
                break
        with suppress(OSError):  # a file system without locks
            lock(self._lock)
        self._schema = self._schema.with_metadata(self._meta | creation())
        self._sink = pa.OSFile(str(self._path), "wb")
        self._stream = pa.ipc.new_stream(self._sink, self._schema)
        self._opened, self._bytes = time.monotonic(), 0

    def _finish(self) -> None:
        if self._stream is None or self._sink is None:
            return
        self._stream.close()
        self._sink.close()
        self._stream = self._sink = None
        assert self._lock is not None
        self._completing.append(self._completer.submit(self._complete, self._path, self._lock))

    def _complete(self, path: Path, locked: IO[bytes]) -> None:
        with locked:
            try:
                done = to_parquet(path, self._group)
            except UnreadableSegmentError as error:  # it may be readable later, or in part
                self._warn(f"{error}; {_STAYS}")
                return
        if done is not None:
            self.files.append(done)
        if done is not None and self._oldest is not None:
            removed = self._oldest.remove(done)
            self.removed += len(removed)
            self.files = [file for file in self.files if file not in removed]


class UnreadableSegmentError(RecordingError):
    """The disk, or the network that it is on, does not give back what was written; the message names the file
    and the reason."""


def to_parquet(path: Path, group: int = _GROUP) -> Path | None:
    """Convert one Arrow stream to a Parquet file in the same folder and remove it; None if it contains no
    row.

    The Parquet file appears under its name only when it is complete.

    Raises:
        UnreadableSegmentError: The stream cannot be read to its end; it stays as it is.
        OSError: The Parquet file cannot be written.
    """
    done, part = path.with_suffix(DONE), path.with_suffix(PARTIAL)
    rows = 0
    try:
        with (
            _opened(path) as stream,
            pa_parquet.ParquetWriter(part, stream.schema, compression="zstd") as writer,
        ):
            pending: list[pa.RecordBatch] = []
            waiting = 0
            while True:
                batch = _next(stream, path)
                if batch is not None:
                    pending.append(batch)
                    waiting += batch.num_rows
                    rows += batch.num_rows
                if pending and (batch is None or waiting >= group):
                    writer.write_table(pa.Table.from_batches(pending))
                    pending, waiting = [], 0
                if batch is None:
                    break
    except pa.ArrowInvalid:
        rows = 0  # not even the schema was written
    except (OSError, UnreadableSegmentError):
        part.unlink(missing_ok=True)  # on a full disk it would keep later rows from being written
        raise
    if rows == 0:
        part.unlink(missing_ok=True)
        path.unlink()
        return None
    with part.open("rb") as written:
        os.fsync(written.fileno())
    part.replace(done)
    path.unlink()
    return done


@contextmanager
def _opened(path: Path) -> Iterator[pa.RecordBatchStreamReader]:
    with ExitStack() as files:
        try:
            source = files.enter_context(pa.OSFile(str(path)))
            stream = files.enter_context(pa.ipc.open_stream(source))
        except FileNotFoundError:
            raise  # somebody has removed it
        except OSError as error:
            raise UnreadableSegmentError(f"{path}: cannot be read: {reason(error)}") from None
        yield stream


def _next(stream: pa.RecordBatchStreamReader, path: Path) -> pa.RecordBatch | None:
    """The next complete batch; None at the end, even if the stream ends in the middle of a batch."""
    try:
        return stream.read_next_batch()
    except OSError as error:
        if error.errno is None:  # Arrow expected more bytes
            return None
        raise UnreadableSegmentError(f"{path}: cannot be read to its end: {reason(error)}") from None
    except (StopIteration, pa.ArrowException):
        return None


def repair(folder: Path, prefix: str = "", warn: Callable[[str], None] = _LOG.warning) -> list[Path]:
    """Complete the segments that a killed writer left open in a folder, and return their Parquet files."""
    for part in folder.glob(f"{prefix}*{PARTIAL}"):
        if not part.with_suffix("").with_suffix(OPEN).exists():
            part.unlink()
    found = [_repaired(path, warn) for path in sorted(folder.glob(f"{prefix}*{OPEN}"))]
    return [path for path in found if path is not None]


def _repaired(path: Path, warn: Callable[[str], None]) -> Path | None:
    try:
        with path.open("rb") as stream:
            with suppress(OSError):  # a file system without locks
                if AVAILABLE and not lock(stream):
                    return None  # another writer has it open
            return to_parquet(path)
    except UnreadableSegmentError as error:
        warn(f"{error}; {_STAYS}")
    except OSError as error:  # such as files of another user
        warn(f"{path}: cannot be completed: {reason(error)}; {_STAYS}")
    return None
