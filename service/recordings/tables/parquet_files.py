"""Parquet files that are there whole or not at all."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.robots.files.whole_file import whole_file


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet."""
    with whole_file(path) as unfinished:
        pa_parquet.write_table(table, unfinished, compression="zstd")
