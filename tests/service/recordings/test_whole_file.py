"""A file that cannot be written whole is not there."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv as pa_csv
import pytest

from contactsense.service.recordings import RecordingError
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.whole_file import whole_file


def _fill(path: Path) -> None:
    with whole_file(path) as unfinished:
        unfinished.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_an_error_leaves_the_file_before(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with whole_file(path) as unfinished:
        unfinished.write_text("before")
    with pytest.raises(OSError, match="No space"):
        _fill(path)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_leaves_no_part_of_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(table: Any, path: Path, *_: Any) -> None:
        path.write_text("timestamp\n0.0")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pa_csv, "write_csv", full)
    with pytest.raises(RecordingError, match=r"table\.csv: cannot write: No space left on device"):
        write_columns(tmp_path / "table.csv", {"timestamp": np.zeros(2)})
    assert list(tmp_path.iterdir()) == []
