"""Arrow streams that cannot be read whole."""

from pathlib import Path

import numpy as np
import pytest

from contactsense.service.recordings.tables.arrow_table import ArrowTable
from contactsense.service.recordings.writing.segment_writer import SegmentWriter
from tests.service.recordings.failing_disk import fail_reading


def test_an_error_of_the_disk_is_no_end_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = SegmentWriter(tmp_path, "a", ("timestamp",), {}, flush_seconds=0.0)
    for i in range(20):
        writer.add((float(i),))
        writer.flush()
    (path,) = tmp_path.iterdir()
    whole, cut = path.read_bytes(), tmp_path / "cut.arrows"
    cut.write_bytes(whole[:-10])
    writer.close()
    path.write_bytes(whole)
    assert _read(cut) == (19, ["the file ends within a batch"])
    fail_reading(monkeypatch, len(whole) // 2)
    rows, problems = _read(path)
    assert 5 < rows < 15
    assert problems == ["the rest cannot be read: Input/output error"]


def _read(path: Path) -> tuple[int, list[str]]:
    table = ArrowTable(path)
    columns = [part["timestamp"] for _, part in table.batches(["timestamp"])]
    rows = np.concatenate(columns)
    np.testing.assert_array_equal(rows, np.arange(len(rows)))
    return len(rows), [str(problem.message) for problem in table.problems]
