"""Folders of Parquet files: those of months may be more than a process may have open, and may go."""

import os
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest

from contactsense.service.recordings.tables.parquet_tables import ParquetFolder

FILES, ROWS = 30, 3


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for i in range(FILES):
        table = pa.table({"timestamp": np.arange(float(ROWS)) + ROWS * i})
        pa_parquet.write_table(table, tmp_path / f"samples-{i:02d}.parquet")
    return tmp_path


@pytest.fixture
def _few_open_files() -> Iterator[None]:
    """This process may open ten more files."""
    lowest = os.open(os.devnull, os.O_RDONLY)
    os.close(lowest)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest + 10, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def times(table: ParquetFolder) -> list[float]:
    return [t for _, columns in table.batches(["timestamp"]) for t in columns["timestamp"].tolist()]


@pytest.mark.usefixtures("_few_open_files")
def test_a_folder_may_have_more_files_than_can_be_open(folder: Path) -> None:
    """That of a service that writes clips, or records, for months."""
    table = ParquetFolder(folder)
    assert table.rows == FILES * ROWS
    assert times(table) == np.arange(FILES * ROWS).tolist()
    assert not table.problems


def test_a_file_that_goes_before_it_is_read_is_told(folder: Path) -> None:
    """A service removes its oldest files."""
    table = ParquetFolder(folder)
    (folder / "samples-01.parquet").unlink()
    assert times(table) == [t for t in range(FILES * ROWS) if not ROWS <= t < 2 * ROWS]
    (problem,) = table.problems
    assert (problem.row_from, problem.row_to, problem.kind) == (ROWS, 2 * ROWS, "cut_short")
    assert "cannot be read: " in problem.message
