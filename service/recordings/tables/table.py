"""What all tables of numbers have in common, whatever file they are in."""

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from contactsense.service.recordings.problems import Problem, RecordingError

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of Arrow's time stamps [s]."""

Columns = dict[str, np.ndarray]
"""Column name -> values, shape (N,), float64."""


class TableFile(Protocol):
    """A table on disk."""

    names: list[str]
    """Names of the numeric columns."""
    others: list[str]
    """The other ones, each with what it holds, for messages."""
    meta: dict[str, str]
    """Metadata of the file."""
    problems: list[Problem]
    """Problems of the file, those found so far in its latest reading included."""
    rows: int | None
    """Number of rows, if it is known before the whole file is read."""

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """Row number of the first row, and the requested columns, batch by batch; at least the rows from
        `first` up to, but not including, `last`."""


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


def numeric(schema: pa.Schema) -> list[str]:
    """Names of the columns of numbers or dates."""
    types = (pa.types.is_integer, pa.types.is_floating, pa.types.is_timestamp)
    return [f.name for f in schema if any(is_type(f.type) for is_type in types)]


def not_numeric(schema: pa.Schema) -> list[str]:
    """The other columns, each with what it holds."""
    numbers = numeric(schema)
    return [f"{field.name} ({_held(field.type)})" for field in schema if field.name not in numbers]


def _held(kind: pa.DataType) -> str:
    types = pa.types
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        return "lists"
    return "text" if types.is_string(kind) or types.is_large_string(kind) else str(kind)


def text_metadata(metadata: dict[bytes, bytes] | None) -> dict[str, str]:
    """Metadata of a file as text, without what Arrow and pandas add."""
    skipped = (b"ARROW:schema", b"pandas")
    items = (metadata or {}).items()
    return {k.decode(errors="replace"): v.decode(errors="replace") for k, v in items if k not in skipped}


def check_twice(path: Path, names: list[str]) -> None:
    """Raise a RecordingError if two columns have the same name."""
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
