"""Tables of numbers from files, batch by batch: CSV, Parquet, Arrow IPC streams, folders of Parquet files.

From a truncated file, everything readable is returned, and the truncation is reported.
"""

import gzip
import io
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet

from contactsense.service.recordings.problems import Problem, RecordingError

RAW_READINGS = "wrench-"
"""Prefix of the tables that `contactsense record` writes in addition to those of the samples."""
_HEAD = 65536
"""Maximum length of the header line of a CSV file [bytes]."""
_BUFFER = 1 << 20
"""Bytes of a Parquet column read at a time: a file that is memory-mapped or read ahead stays in memory."""

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of Arrow's time stamps [s]."""
_ARROW = b"ARROW1"
"""The first bytes of an Arrow IPC file; a stream does not have them."""
_GZIP = b"\x1f\x8b"
"""The first bytes of a file that is packed with gzip."""

Columns = dict[str, np.ndarray]
"""Column name -> values, shape (N,), float64."""


class TableFile(Protocol):
    """A table on disk."""

    names: list[str]
    """Names of the numeric columns."""
    others: list[str]
    """Names of the other ones."""
    meta: dict[str, str]
    """Metadata of the file."""
    problems: list[Problem]
    """Problems found so far while reading."""
    rows: int | None
    """Number of rows, if it is known before the whole file is read."""

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """Row number of the first row, and the requested columns, batch by batch; at least the rows from
        `first` up to, but not including, `last`."""


def open_table(path: Path) -> TableFile:
    """The table in a file or folder.

    Raises:
        RecordingError: It cannot be read, or is not a table.
    """
    try:
        if path.is_dir():
            return _ParquetFolder(path)
        suffix = path.suffix.lower()  # some programs write names in capitals
        if suffix == ".parquet":
            return _Parquet(path)
        if suffix in (".arrow", ".arrows", ".feather"):
            return _ArrowFile(path)
        return _Csv(path)
    except (OSError, pa.ArrowException) as error:
        raise RecordingError(f"{path}: cannot read the recording: {reason(error)}") from None


def chosen_rows(
    batches: Iterator[tuple[int, Columns]], first: int, last: int | None
) -> Iterator[tuple[int, Columns]]:
    """Trim batches to the rows from `first` up to, but not including, `last`."""
    for row, columns in batches:
        count = len(next(iter(columns.values())))
        begin, end = max(first - row, 0), count if last is None else min(last - row, count)
        if last is not None and row >= last:
            return
        if begin < end:
            yield row + begin, {name: values[begin:end] for name, values in columns.items()}


def reason(error: Exception) -> str:
    """The error message of the operating system or of Arrow in one line."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split())


def _numeric(schema: pa.Schema) -> list[str]:
    types = (pa.types.is_integer, pa.types.is_floating, pa.types.is_timestamp)
    return [f.name for f in schema if any(is_type(f.type) for is_type in types)]


def _not_numeric(schema: pa.Schema) -> list[str]:
    numeric = _numeric(schema)
    return [name for name in schema.names if name not in numeric]


def _text(metadata: dict[bytes, bytes] | None) -> dict[str, str]:
    skipped = (b"ARROW:schema", b"pandas")
    return {k.decode(): v.decode(errors="replace") for k, v in (metadata or {}).items() if k not in skipped}


def _check_twice(path: Path, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise RecordingError(f"{path}: {name}: the column is there twice")


def floats(batch: pa.RecordBatch, names: list[str]) -> Columns:
    """Columns of numbers or dates as float64; dates are seconds since 1970."""
    columns = {}
    for name in names:
        column = batch.column(name)
        if pa.types.is_timestamp(column.type):  # as pandas writes dates
            unit = _SECONDS[column.type.unit]
            column = pc.multiply(pc.cast(column, pa.int64()).cast(pa.float64(), safe=False), unit)
        elif not pa.types.is_float64(column.type):
            column = pc.cast(column, pa.float64(), safe=False)
        columns[name] = column.to_numpy(zero_copy_only=False)
    return columns


class _Parquet:
    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []
        self._file = pa_parquet.ParquetFile(path, buffer_size=_BUFFER, pre_buffer=False)
        _check_twice(path, self._file.schema_arrow.names)
        self.names, self.others = _numeric(self._file.schema_arrow), _not_numeric(self._file.schema_arrow)
        self.meta = _text(self._file.schema_arrow.metadata)
        self.rows: int | None = self._file.metadata.num_rows

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        row, groups = self._groups(first, last)
        source = self._file.iter_batches(columns=names, batch_size=65536, row_groups=groups)
        while True:
            try:
                batch = next(source)
            except StopIteration:
                return
            except (OSError, pa.ArrowException) as error:
                self.problems.append(
                    Problem(
                        row, self._file.metadata.num_rows, "cut_short", f"cannot be read: {reason(error)}"
                    )
                )
                return
            yield row, floats(batch, names)
            row += batch.num_rows

    def _groups(self, first: int, last: int | None) -> tuple[int, list[int]]:
        """The row groups that contain the requested rows, and the number of their first row."""
        groups: list[int] = []
        begin = row = 0
        for i in range(self._file.metadata.num_row_groups):
            count = self._file.metadata.row_group(i).num_rows
            if row + count > first and (last is None or row < last):
                if not groups:
                    begin = row
                groups.append(i)
            row += count
        return begin, groups


class _ParquetFolder:
    """All Parquet files below a folder, sorted by name, without tables of raw readings."""

    def __init__(self, path: Path) -> None:
        files = sorted(file for file in path.rglob("*.parquet") if not file.name.startswith(RAW_READINGS))
        if not files:
            raise RecordingError(f"{path}: expected a folder with .parquet files of samples, got none")
        self._parts = [_Parquet(file) for file in files]
        self.names = [n for n in self._parts[0].names if all(n in part.names for part in self._parts)]
        self.others = self._parts[0].others
        self.meta = self._parts[0].meta
        self.problems: list[Problem] = []
        self.rows: int | None = sum(part.rows or 0 for part in self._parts)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        row = 0
        for part in self._parts:
            begin = row
            for _, columns in part.batches(names):
                yield row, columns
                row += len(next(iter(columns.values())))
            self.problems += [
                replace(p, row_from=p.row_from + begin, row_to=p.row_to + begin) for p in part.problems
            ]


class _ArrowFile:
    """Arrow IPC: a stream, or the file format that pandas writes as Feather."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []
        self.rows: int | None = None
        with path.open("rb") as file:
            self._indexed = file.read(len(_ARROW)) == _ARROW
        with pa.OSFile(str(path)) as source:
            schema = self._open(source).schema
        self.names, self.others = _numeric(schema), _not_numeric(schema)
        self.meta = _text(schema.metadata)

    def _open(self, source: pa.OSFile) -> Any:
        return pa.ipc.open_file(source) if self._indexed else pa.ipc.open_stream(source)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        row = 0
        with pa.OSFile(str(self._path)) as source, self._open(source) as opened:
            parts = map(opened.get_batch, range(opened.num_record_batches)) if self._indexed else opened
            source_batches = iter(parts)
            while True:
                try:
                    batch = next(source_batches)
                except StopIteration:
                    return
                except (OSError, pa.ArrowException):
                    self.problems.append(Problem(row, row, "cut_short", "the file ends within a batch"))
                    return
                yield row, floats(batch, names)
                row += batch.num_rows


class _Gzip(io.RawIOBase):
    """A compressed file; a truncated or damaged one ends there, and `cut_short` is set."""

    def __init__(self, path: Path) -> None:
        self._file = gzip.open(path, "rb")  # noqa: SIM115 (closed by `close`)
        self.cut_short = False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        try:
            data = self._file.read1(len(buffer))
        except (EOFError, zlib.error, gzip.BadGzipFile):
            self.cut_short, data = True, b""
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()


class _Csv:
    """CSV as written by ur_rtde (commas) or by UR's own client (blanks), optionally compressed with gzip."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.meta: dict[str, str] = {}
        self.problems: list[Problem] = []
        self.rows: int | None = None
        self.others: list[str] = []
        with path.open("rb") as file:
            self._packed = file.read(len(_GZIP)) == _GZIP
        with self._open() as stream:
            # Spreadsheets begin a text in UTF-8 with a mark, which is no part of the first name.
            head = (stream.read(_HEAD) or b"").split(b"\n", 1)[0].decode("utf-8-sig", "replace").strip()
        if not head.replace("\t", "").isprintable():
            raise RecordingError(f"{path}: expected a table as text, got binary data")
        if ";" in head and not {",", "\t", " "} & set(head):
            raise RecordingError(
                f"{path}: expected columns separated by commas, tabs or blanks, and decimal points, "
                "got semicolons"
            )
        self._delimiter = "," if "," in head else "\t" if "\t" in head else " "
        self.names = [name.strip().strip('"') for name in head.split(self._delimiter)]
        if not any(name and not _is_number(name) for name in self.names):
            raise RecordingError(f"{path}: expected a header line that names the columns, got {head[:60]!r}")
        _check_twice(path, self.names)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        done = 0
        try:
            for row, columns in self._typed(names, pa.float64()):
                yield row, columns
                done = row + len(next(iter(columns.values())))
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot read the recording: {reason(error)}") from None
        except pa.ArrowInvalid as error:
            if "conversion error" not in str(error).lower():
                raise RecordingError(f"{self._path}: {reason(error)}") from None
            # A cell is not a number: read text, and mark what cannot be converted.
            self.problems.clear()
            yield from chosen_rows(self._typed(names, pa.string()), done, None)

    def _open(self) -> Any:
        return io.BufferedReader(_Gzip(self._path)) if self._packed else self._path.open("rb")

    def _typed(self, names: list[str], kind: pa.DataType) -> Iterator[tuple[int, Columns]]:
        rejected: list[Problem] = []

        def skip(row: pa_csv.InvalidRow) -> str:
            number = (row.number or 2) - 2
            message = f"expected {row.expected_columns} columns, got {row.actual_columns}; row ignored"
            rejected.append(Problem(number, number + 1, "bad_row", message))
            return "skip"

        row = 0
        with self._open() as stream:
            reader = pa_csv.open_csv(
                stream,
                read_options=pa_csv.ReadOptions(
                    use_threads=False, block_size=1 << 22, skip_rows=1, column_names=self.names
                ),
                parse_options=pa_csv.ParseOptions(delimiter=self._delimiter, invalid_row_handler=skip),
                convert_options=pa_csv.ConvertOptions(
                    include_columns=names, column_types=dict.fromkeys(names, kind)
                ),
            )
            while True:
                try:
                    batch = reader.read_next_batch()
                except StopIteration:
                    break
                columns = floats(batch, names) if kind == pa.float64() else self._parsed(batch, names, row)
                yield row, columns
                row += batch.num_rows
            if isinstance(stream, io.BufferedReader) and getattr(stream.raw, "cut_short", False):
                rejected.append(
                    Problem(row, row, "cut_short", "the packed file ends too early or is damaged here")
                )
        self.problems += rejected

    def _parsed(self, batch: pa.RecordBatch, names: list[str], first: int) -> Columns:
        columns = {}
        for name in names:
            cells = batch.column(name).to_pylist()
            values = np.array([_number(cell) for cell in cells])
            bad = [i for i, c in enumerate(cells) if c not in ("", None) and _number(c) != _number(c)
                   and c.strip().lower() not in ("nan", "null", "na")]  # fmt: skip
            runs = np.split(bad, np.flatnonzero(np.diff(bad) > 1) + 1) if bad else []
            for run in runs:
                message = f"{name}: expected numbers, got {cells[run[0]]!r}"
                self.problems.append(
                    Problem(first + int(run[0]), first + int(run[-1]) + 1, "bad_row", message)
                )
            columns[name] = values
        return columns


def _number(cell: str | None) -> float:
    try:
        return float(cell) if cell else float("nan")
    except ValueError:
        return float("nan")


def _is_number(text: str) -> bool:
    return _number(text.strip('"')) == _number(text.strip('"'))
