"""Tables of numbers, and of dates, from CSV, which may be packed with gzip."""

import gzip
import io
import math
import re
import zlib
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.tables.table import Columns, check_twice, chosen_rows, floats, reason

_HEAD = 65536
"""Maximum length of the header line of a CSV file [bytes]."""
_PART = 1 << 20
"""Length of the parts in which a text is read [bytes]; the rest of a line comes on top."""
_GZIP = b"\x1f\x8b"
"""The first bytes of a file that is packed with gzip."""
_DECIMAL_COMMA, _QUOTED_DECIMAL_COMMA = re.compile(rb"\d,\d"), re.compile(rb'"[+-]?\d+,\d+')
_DATE = re.compile(r"\d{1,4}([./-])\d{1,2}\1\d{1,4}")
"""A date in any order of day, month and year."""
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
"""The first bytes of a text in UTF-16, such as the "Unicode text" of spreadsheets."""
_BEFORE_HEADER = re.compile(rb"(?:\xef\xbb\xbf)?(?:[ \t]*\r?\n|\"?sep=.\"?\r?\n)*")
"""The mark with which spreadsheets begin a text in UTF-8, empty lines, and one that names the delimiter."""
_LONGEST_CELL = 40
"""A longer cell is cut in messages."""
_BLANKS, _EDGES = re.compile(rb"[ \t]+"), re.compile(rb"^ | (?=\r?$)", re.MULTILINE)
_COMMENT = re.compile(r"[#%]+\s*")
"""What NumPy and MATLAB write before a header."""
_MISSING = (
    "nan",
    "-nan",
    "nan(ind)",
    "-nan(ind)",
    "1.#qnan",
    "-1.#ind",
    "null",
    "none",
    "na",
    "n/a",
    "#n/a",
    "-",
)
"""Words for a number that is missing, as different programs write them."""
_OTHER_BEGINNINGS = {
    "{": "JSON",
    "[": "JSON",
    "#ROSBAG": "a ROS 1 bag",
    "BZh": "a file packed with bzip2",
    "MATLAB": "a file of MATLAB",
    "#": "a comment",
    "%": "a comment",
}
"""First characters of files whose first line is no header, and what they are."""


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


class _ChangedLines(io.RawIOBase):
    """A text of which something is changed while it is read, some whole lines at a time.

    Args:
        file: The text; closed with this.
        change: Returns what is read in place of these lines.
    """

    def __init__(self, file: io.BufferedReader, change: Callable[[bytes], bytes]) -> None:
        self._file, self._change, self._rest = file, change, b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        # A line is limited, too: zeros at the end of a file, which a computer that crashed left, are one.
        while not self._rest and (lines := self._file.read(_PART) + self._file.readline(_PART)):
            self._rest = self._change(lines)
        data, self._rest = self._rest[: len(buffer)], self._rest[len(buffer) :]
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()


def _as_utf8(lines: bytes) -> bytes:
    """Replace what is no UTF-8: Arrow refuses a file in which a row that it skips has such a letter."""
    return lines if lines.isascii() else lines.decode("utf-8", "replace").encode()


def _single_blanks(lines: bytes) -> bytes:
    """Of numbers in columns, padded with blanks, leave one blank between them."""
    return _EDGES.sub(b"", _BLANKS.sub(b" ", _as_utf8(lines)))


class CsvTable:
    """CSV as written by ur_rtde (commas), by UR's own client (blanks) or by spreadsheets (semicolons),
    optionally compressed with gzip."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.meta: dict[str, str] = {}
        self.problems: list[Problem] = []
        self.rows: int | None = None
        self.others: list[str] = []
        with path.open("rb") as file:
            self._packed = file.read(len(_GZIP)) == _GZIP
        with self._open() as stream:
            opening = stream.read(_HEAD) or b""
        if opening.startswith(_UTF16):
            raise RecordingError(f"{path}: expected text in UTF-8, got UTF-16: save it as CSV in UTF-8")
        before = _BEFORE_HEADER.match(opening)
        assert before is not None  # it may be empty
        self._skipped = 1 + before.group().count(b"\n")
        first, _, rest = opening[before.end() :].partition(b"\n")
        head = first.decode("utf-8", "replace").strip()
        second = rest.partition(b"\n")[0].decode("utf-8", "replace").strip("\r")
        named = _commented_names(head, second)
        if named is not None:
            head = second
        if "\r" in head and head.replace("\t", "").replace("\r", "").isprintable():
            raise RecordingError(
                f"{path}: expected lines that end with LF or CR LF, got CR alone: save it anew"
            )
        if not head.replace("\t", "").isprintable():
            raise RecordingError(f"{path}: expected a table as text, got binary data")
        for beginning, found in _OTHER_BEGINNINGS.items():
            if head.startswith(beginning):
                raise RecordingError(
                    f"{path}: expected CSV with a header line that names the columns, Parquet, Arrow, MCAP "
                    f"or rosbag2, got {found}: {head[:40]!r}"
                )
        # Spreadsheets with decimal commas write semicolons or tabs between columns, others quotes.
        self._delimiter = _delimiter(head)
        decimal_comma = _QUOTED_DECIMAL_COMMA if self._delimiter == "," else _DECIMAL_COMMA
        self._decimal_commas = decimal_comma.search(rest) is not None
        self.names = named or _names(head, self._delimiter)
        words = [name for name in self.names if name and not _is_number(name)]
        if not words or (len(self.names) > 2 and len(words) == 1):  # numbers, or a title
            got = repr(head[:60]) if opening.strip() else "an empty file"
            raise RecordingError(f"{path}: expected a header line that names the columns, got {got}")
        check_twice(path, words)
        padded = b"  " in opening or _EDGES.search(opening) is not None
        self._padded = self._delimiter == " " and padded
        if (
            self._delimiter != " "
            and second.endswith(self._delimiter)
            and second.count(self._delimiter) == len(self.names)
        ):
            self.names.append("")  # a program writes a delimiter after each number

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """As `TableFile.batches`."""
        self.problems.clear()
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
            # A cell is not a number: read text, convert dates, and mark what cannot be converted.
            self.problems.clear()
            yield from chosen_rows(self._typed(names, pa.string()), done, None)

    def _open(self) -> Any:
        return io.BufferedReader(_Gzip(self._path)) if self._packed else self._path.open("rb")

    def _typed(self, names: list[str], kind: pa.DataType) -> Iterator[tuple[int, Columns]]:
        rejected: list[Problem] = []

        def skip(row: pa_csv.InvalidRow) -> str:
            number = (row.number or self._skipped + 1) - self._skipped - 1
            message = f"expected {row.expected_columns} columns, got {row.actual_columns}; row ignored"
            rejected.append(Problem(number, number + 1, "bad_row", message))
            return "skip"

        row = 0
        with self._open() as stream:
            lines = _ChangedLines(stream, _single_blanks if self._padded else _as_utf8)
            reader = pa_csv.open_csv(
                io.BufferedReader(lines),
                read_options=pa_csv.ReadOptions(
                    use_threads=False, block_size=1 << 22, skip_rows=self._skipped, column_names=self.names
                ),
                parse_options=pa_csv.ParseOptions(delimiter=self._delimiter, invalid_row_handler=skip),
                convert_options=pa_csv.ConvertOptions(
                    include_columns=names,
                    column_types=dict.fromkeys(names, kind),
                    decimal_point="," if self._decimal_commas else ".",
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
        cells: dict[str, list[str | None]] = {name: batch.column(name).to_pylist() for name in names}
        columns = {name: np.array([self._number(cell) for cell in cells[name]]) for name in names}
        bad = {name: _words(cells[name], columns[name]) for name in names}
        rows = set[int].intersection(*bad.values())  # such as units below the header
        for begin, end in _runs(rows):
            words = ", ".join(_quoted(cells[name][begin]) for name in names[:3]) + ", ..." * (len(names) > 3)
            self._report(first + begin, first + end, f"expected numbers, got {words}; row ignored")
        for name in names:
            for begin, end in _runs(bad[name] - rows):
                cell = cells[name][begin]
                dates = ", or dates as 2026-03-31T12:00:00.002" if _DATE.search(cell or "") else ""
                message = f"{name}: expected numbers{dates}, got {_quoted(cell)}"
                self._report(first + begin, first + end, message)
        return columns

    def _number(self, cell: str | None) -> float:
        """`_number` of a cell with the decimal mark of the file."""
        return _number(cell.replace(",", ".") if cell and self._decimal_commas else cell)

    def _report(self, row_from: int, row_to: int, message: str) -> None:
        self.problems.append(Problem(row_from, row_to, "bad_row", message))


def _quoted(cell: str | None) -> str:
    """A cell in quotes, of a long one the beginning: zeros at the end of a file may be one."""
    return repr(cell) if cell is None or len(cell) <= _LONGEST_CELL else f"{cell[:_LONGEST_CELL]!r}..."


def _delimiter(line: str) -> str:
    """What is between the columns of a line."""
    return next((mark for mark in ";,\t" if mark in line), " ")


def _names(head: str, delimiter: str) -> list[str]:
    names = head.split() if delimiter == " " else head.split(delimiter)
    return [name.strip().strip('"') for name in names]


def _commented_names(head: str, second: str) -> list[str] | None:
    """The names in a header behind a comment mark, as `numpy.savetxt` writes it, perhaps with another
    delimiter than in the rows; None: it is no such line.

    Args:
        head: The first line.
        second: The next one.
    """
    mark = _COMMENT.match(head)
    if mark is None:
        return None
    numbers = _names(second.strip(), _delimiter(second.strip()))
    names = _names(head[mark.end() :], _delimiter(head[mark.end() :]))
    are_numbers = all(_is_number(cell) or cell.lower() in ("", *_MISSING) for cell in numbers)
    if len(names) != len(numbers) or not are_numbers or any(map(_is_number, names)):
        return None
    return names


def _words(cells: list[str | None], values: np.ndarray) -> set[int]:
    """Which cells of a column are neither numbers nor dates nor empty."""
    return {
        int(i)
        for i in np.flatnonzero(np.isnan(values))
        if (cell := cells[i]) and cell.strip().lower().replace(",", ".") not in _MISSING
    }


def _runs(rows: set[int]) -> list[tuple[int, int]]:
    """First row of each run of rows that follow each other, and the row after its last one."""
    if not rows:
        return []
    ordered = np.array(sorted(rows))
    runs = np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
    return [(int(run[0]), int(run[-1]) + 1) for run in runs]


def _number(cell: str | None) -> float:
    """A cell as a number, a date as seconds since 1970; NaN for others."""
    try:
        return float(cell) if cell else float("nan")
    except ValueError:
        return _seconds(cell or "")


def _seconds(cell: str) -> float:
    """Seconds since 1970 of a date and time in ISO 8601, in UTC if it names no zone; NaN for others."""
    try:
        date = datetime.fromisoformat(cell.strip())
    except ValueError:
        return float("nan")
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _is_number(text: str) -> bool:
    return not math.isnan(_number(text.strip('"').replace(",", ".")))
