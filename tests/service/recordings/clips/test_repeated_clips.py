"""A clip of what was recorded anyway is not read a second time."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest

from contactsense.service.analysis.fleet.segments import find_recordings
from contactsense.service.recordings.clips.repeated_clips import without_repeated_clips
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.tables.parquet_tables import ParquetFolder


def _table(path: Path, first: float, last: float) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    times = np.arange(first, last, 0.1)
    write_columns(path, {"timestamp": times - 50.0, "host_time": times})
    return path


@pytest.mark.parametrize(
    ("first", "last", "repeated"),
    [
        (110.0, 120.0, True),
        (125.0, 135.0, True),  # where one file ends and the next begins
        (95.0, 105.0, False),
        (155.0, 165.0, False),
        (165.0, 185.0, False),  # the recording was off for some time
        (200.0, 215.0, False),
    ],
)
def test_clips_within_a_recording_are_repeated(
    tmp_path: Path, first: float, last: float, repeated: bool
) -> None:
    recorded = [
        _table(tmp_path / "service-0000.parquet", 100.0, 130.0),
        _table(tmp_path / "service-0001.parquet", 130.0, 160.0),
        _table(tmp_path / "service-0002.parquet", 180.0, 190.0),
    ]
    clip = _table(tmp_path / "clip-20260101T000000-000001.parquet", first, last)
    assert without_repeated_clips([clip, *recorded]) == [*([] if repeated else [clip]), *recorded]


def test_clips_alone_and_other_files_stay(tmp_path: Path) -> None:
    files = [
        _table(tmp_path / "clip-1.parquet", 110.0, 120.0),
        _table(tmp_path / "other" / "service-1.parquet", 100.0, 130.0),
        tmp_path / "recording.csv",
    ]
    assert without_repeated_clips(files) == files
    for name in ("clip-2.parquet", "service-2.parquet"):
        (tmp_path / name).write_bytes(b"PAR1, then nothing")
    _table(tmp_path / "service-3.parquet", 300.0, 310.0)
    kept = [*files, *(tmp_path / f"{name}.parquet" for name in ("clip-2", "service-2", "service-3"))]
    assert without_repeated_clips(kept) == kept


@pytest.mark.parametrize("times", [{}, {"host_time": np.array(["2026-01-01", "2026-01-02"], "M8[ms]")}])
def test_files_of_other_programs_may_have_such_names(tmp_path: Path, times: dict[str, np.ndarray]) -> None:
    """Without the column of times, or with dates in it."""
    names = [f"{name}.parquet" for name in ("clip-1", "service-1", "service-2")]
    for name in names:
        pa_parquet.write_table(pa.table({"timestamp": [0.0, 0.1], **times}), tmp_path / name)
    assert ParquetFolder(tmp_path).rows == 6


def test_a_folder_is_read_and_analysed_without_them(tmp_path: Path) -> None:
    _table(tmp_path / "clip-20260101T000000-000001.parquet", 110.0, 120.0)
    recording = _table(tmp_path / "service-0000.parquet", 100.0, 130.0)
    assert ParquetFolder(tmp_path).rows == 300
    assert [file.path for file in find_recordings((tmp_path,))] == [recording]
