"""A recording that cannot be written whole is not there."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv as pa_csv
import pytest

from contactsense.service.recordings import RecordingError
from contactsense.service.recordings.export import write_columns


def test_a_full_disk_leaves_no_part_of_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(table: Any, path: Path, *_: Any) -> None:
        path.write_text("timestamp\n0.0")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pa_csv, "write_csv", full)
    with pytest.raises(RecordingError, match=r"table\.csv: cannot write: No space left on device"):
        write_columns(tmp_path / "table.csv", {"timestamp": np.zeros(2)})
    assert list(tmp_path.iterdir()) == []
