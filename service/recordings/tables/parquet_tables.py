"""Tables of numbers from Parquet files, and from folders of them."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.service.recordings.clips.repeated_clips import without_repeated_clips
from contactsense.service.recordings.file_format import format_of
from contactsense.service.recordings.metadata import (
    CONFLICT,
    PREFIX,
    carried_scene,
    removed_delays_of_meta,
)
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.tables.table import (
    Columns,
    check_twice,
    floats,
    not_numeric,
    numeric,
    reason,
    text_metadata,
)

RAW_READINGS = "wrench-"
"""Prefix of the tables that `contactsense record` writes in addition to those of the samples."""
_BUFFER = 1 << 20
"""Bytes of a Parquet column read at a time: a file that is memory-mapped or read ahead stays in memory."""


class ParquetTable:
    """A Parquet file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []
        # Closed at once: a folder may have more files than a process may have open.
        with pa_parquet.ParquetFile(path) as file:
            schema, self._metadata = file.schema_arrow, file.metadata
        check_twice(path, schema.names)
        self.names, self.others = numeric(schema), not_numeric(schema)
        self.meta = text_metadata(schema.metadata)
        self.rows: int | None = self._metadata.num_rows

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """As `TableFile.batches`."""
        self.problems.clear()
        row, groups = self._groups(first, last)
        source = self._stored(names, groups)
        while True:
            try:
                batch = next(source)
            except StopIteration:
                return
            except (OSError, pa.ArrowException) as error:
                self.problems.append(
                    Problem(row, self._metadata.num_rows, "cut_short", f"cannot be read: {reason(error)}")
                )
                return
            yield row, floats(batch, names)
            row += batch.num_rows

    def _stored(self, names: list[str], groups: list[int]) -> Iterator[pa.RecordBatch]:
        with pa_parquet.ParquetFile(
            self._path, metadata=self._metadata, buffer_size=_BUFFER, pre_buffer=False
        ) as file:
            yield from file.iter_batches(columns=names, batch_size=65536, row_groups=groups)

    def _groups(self, first: int, last: int | None) -> tuple[int, list[int]]:
        """The row groups that contain the requested rows, and the number of their first row."""
        groups: list[int] = []
        begin = row = 0
        for i in range(self._metadata.num_row_groups):
            count = self._metadata.row_group(i).num_rows
            if row + count > first and (last is None or row < last):
                if not groups:
                    begin = row
                groups.append(i)
            row += count
        return begin, groups


class ParquetFolder:
    """All Parquet files below a folder, sorted by name, without tables of raw readings and without clips of
    what was recorded anyway."""

    def __init__(self, path: Path) -> None:
        tables = (file for file in path.rglob("*") if format_of(file) == ".parquet")
        found = (file for file in tables if not file.name.startswith(RAW_READINGS))
        files = without_repeated_clips(sorted(found))
        if not files:
            raise RecordingError(f"{path}: expected a folder with .parquet files of samples, got none")
        self._parts = [ParquetTable(file) for file in files]
        self.names = [n for n in self._parts[0].names if all(n in part.names for part in self._parts)]
        self.others = self._parts[0].others
        first = self._parts[0].meta
        removed = removed_delays_of_meta(first, str(files[0]))
        self.meta = dict(first)
        for file, part in zip(files, self._parts, strict=True):
            both = f"{files[0].relative_to(path)} and {file.relative_to(path)}"
            if removed_delays_of_meta(part.meta, str(file)) != removed:
                raise RecordingError(
                    f"{path}: in one of {both} the delays of the sensors have been taken off, in the other "
                    "they have not, or others have: read them one by one"
                )
            if carried_scene(part.meta) != carried_scene(first):
                self.meta[PREFIX + CONFLICT] = both
        self.problems: list[Problem] = []
        self.rows: int | None = sum(part.rows or 0 for part in self._parts)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """As `TableFile.batches`."""
        self.problems.clear()
        row = 0
        for part in self._parts:
            begin = row
            for _, columns in part.batches(names):
                yield row, columns
                row += len(next(iter(columns.values())))
            self.problems += [
                replace(p, row_from=p.row_from + begin, row_to=p.row_to + begin) for p in part.problems
            ]
