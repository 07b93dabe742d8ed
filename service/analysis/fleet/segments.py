"""Recordings of a dataset, and their division into segments for analysis.

The division depends only on the recording, never on the workers: any number of workers, and any interrupted
and resumed run, gives the same contacts. Each segment is read from some time before its start, when nothing
touches the arm, so that biases and observers have settled, and on after its end until the contacts that began
in it have ended.
"""

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.sensors.timing import LONGEST_FIRST_STEP
from contactsense.service.recordings import RecordingError, date_in
from contactsense.service.recordings.clips.repeated_clips import without_repeated_clips
from contactsense.service.recordings.file_format import format_of
from contactsense.service.recordings.file_names import check_name
from contactsense.service.recordings.tables.parquet_tables import RAW_READINGS
from contactsense.service.recordings.tables.table import floats

SEGMENT_TIME = 600.0
"""Length of a segment [s]."""
WARM_UP = 60.0
"""Time before a segment at which reading starts [s]: six times the memory of the bias filter."""
REACH = 3600.0
"""A contact that is active where reading starts is followed back over at most this time [s]."""
UNKNOWN = "unknown"
"""Robot of a recording that is in no folder which names it, and date of one that does not know its own
either."""
SUFFIXES = (".parquet", ".csv", ".csv.gz", ".mcap", ".db3", ".arrows", ".arrow", ".feather")
RESULTS = ("contacts", "parts", "robots.parquet", "days.parquet")
"""Tables in the folder of the results."""
_RESULTS_BESIDE = {
    "fleet.html": RESULTS,
    "report.html": ("contacts.parquet", "contacts.csv", "contacts.mcap", "estimates.parquet"),
}
"""The same beside the report of any dataset, and of a single recording."""
_PART = re.compile(r"/parts/[0-9a-f]{16}/[0-9a-f]{16}-[0-9]{5}\.parquet$")
"""The end of the path of a segment's result: an analysis that was interrupted has no report yet."""


@dataclass(frozen=True)
class DatasetFile:
    """One recording of a dataset."""

    path: Path
    """Its path on disk."""
    name: str
    """Its path within the dataset."""
    robot: str
    """Name of the robot, from a folder `robot=NAME` above it; `UNKNOWN` without one."""
    date: str
    """Date, from a folder `date=YYYY-MM-DD` above it, or else from the recording itself; `UNKNOWN` without
    either."""

    @property
    def key(self) -> str:
        """A name for its results, derived from its path, sizes and modification times."""
        files = sorted(self.path.iterdir()) if self.path.is_dir() else [self.path]
        stamps = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files]
        text = f"{self.name} {stamps}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Segment:
    """Rows of one recording that are analysed as one task."""

    file: DatasetFile
    """The recording."""
    key: str
    """Its key."""
    index: int
    """Number of the segment in the recording."""
    count: int
    """Number of segments of the recording."""
    first: int
    """Its first row."""
    last: int | None
    """Row after its last one; None: to the end."""
    begin: int
    """Row at which reading starts, unless a contact is active there."""
    earliest: int
    """Row at which it starts at the earliest if so."""


def find_recordings(paths: tuple[Path, ...], out: Path | None = None) -> list[DatasetFile]:
    """All recordings among files and below folders, each once; those below a folder are sorted by name.

    A name is the path below the folder that was given, or, if two would have the same name, below the folder
    that is common to all.

    Args:
        paths: Files and folders.
        out: Folder of the results, which are no recordings, should it be in one of the folders; nor are those
            of other analyses, which their reports tell.

    Raises:
        FileNotFoundError: a path does not exist, or there is no recording; the message names it.
        RecordingError: a name is not UTF-8.
    """
    found = []
    for path in paths:
        if path.is_dir():
            found += [_file(p, p.relative_to(path)) for p in _inside(path, out)]
        elif path.exists():
            check_name(path)
            found.append(_file(path, Path(path.name)))
        else:
            raise FileNotFoundError(f"{path}: expected a recording or a folder of recordings, found nothing")
    if not found:
        raise FileNotFoundError(
            f"{', '.join(map(str, paths))}: expected recordings ({', '.join(SUFFIXES)}), found none"
        )
    files = list({file.path: file for file in found}.values())
    if len({file.name for file in files}) == len(files):
        return files
    shared = os.path.commonpath([file.path for file in files])
    return [replace(file, name=file.path.relative_to(shared).as_posix()) for file in files]


def _results(folder: Path, out: Path | None) -> set[Path]:
    """Files and folders below a folder that analyses wrote, resolved."""
    own = [] if out is None else [out / name for name in RESULTS]
    others = (
        page.parent / name
        for report, names in _RESULTS_BESIDE.items()
        for page in folder.rglob(report)
        for name in names
    )
    return {path.resolve() for path in (*own, *others)}


def _inside(folder: Path, out: Path | None) -> list[Path]:
    """Recordings below a folder; a rosbag2 folder is one. A table of raw force/torque readings is not, nor
    are a clip of what was recorded anyway and the results of an analysis, complete or not."""
    results = _results(folder, out)
    bags = {p.parent for name in ("metadata.yaml", "*.db3") for p in folder.rglob(name)} - {folder}
    files = (p for p in folder.rglob("*") if p.is_file() and p.name.lower().endswith(SUFFIXES))
    single = {p for p in files if not p.name.startswith((".", RAW_READINGS)) and p.parent not in bags}
    found = sorted(
        p
        for p in single | bags
        if results.isdisjoint((p.resolve(), *p.resolve().parents)) and not _PART.search(p.as_posix())
    )
    for path in found:
        check_name(path)
    return without_repeated_clips(found)


def segments(file: DatasetFile, length: float = SEGMENT_TIME) -> Iterator[Segment]:
    """The segments of a recording; a file other than Parquet is one segment.

    Args:
        file: The recording.
        length: Length of a segment [s].
    """
    rows, rate = _rows_and_rate(file.path) if format_of(file.path) == ".parquet" else (0, 0.0)
    size = max(round(length * rate), 1)
    if rate <= 0.0 or rows <= 1.5 * size:
        yield Segment(file, file.key, 0, 1, 0, None, 0, 0)
        return
    count, key = -(-rows // size), file.key
    for index in range(count):
        first, last = index * size, (index + 1) * size
        yield Segment(
            file,
            key,
            index,
            count,
            first,
            last if last < rows else None,
            max(first - round(WARM_UP * rate), 0),
            max(first - round(REACH * rate), 0),
        )


def _rows_and_rate(path: Path) -> tuple[int, float]:
    """Number of rows of a Parquet file, and rows per second; (0, 0) if they cannot be determined: reading the
    file will report why."""
    try:
        file = pa_parquet.ParquetFile(path)
        rows = file.metadata.num_rows
        (batch,) = file.read_row_group(0, columns=["timestamp"]).combine_chunks().to_batches()
        times = floats(batch, ["timestamp"])["timestamp"]
        span = float(times[-1] - times[0])
    except (OSError, pa.ArrowException, KeyError, ValueError):
        return 0, 0.0
    # Where samples seem to be further apart, the unit is another one, and segments would be tiny.
    plausible = 0.0 < span <= LONGEST_FIRST_STEP * (len(times) - 1)
    return rows, (len(times) - 1) / span if plausible else 0.0


def _file(path: Path, name: Path) -> DatasetFile:
    # The folder that names the robot may be the one that was given, as of `analyze robot=*`.
    folders = Path(os.path.abspath(path)).parts[:-1]
    keys = dict(part.split("=", 1) for part in folders if "=" in part)
    robot, date = keys.get("robot") or UNKNOWN, keys.get("date") or _own_date(path) or UNKNOWN
    return DatasetFile(path.resolve(), name.as_posix(), robot, date)


def _own_date(path: Path) -> str | None:
    try:
        return date_in(path)
    except RecordingError:
        return None  # the analysis will tell why it cannot be read
