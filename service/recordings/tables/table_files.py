"""Tables of numbers from files, batch by batch: CSV, Parquet, Arrow IPC streams, folders of Parquet files.

From a truncated file, everything readable is returned, and the truncation is reported.
"""

from pathlib import Path

import pyarrow as pa

from contactsense.service.recordings.file_format import format_of
from contactsense.service.recordings.file_names import check_name
from contactsense.service.recordings.problems import RecordingError
from contactsense.service.recordings.tables.arrow_table import ArrowTable
from contactsense.service.recordings.tables.csv_table import CsvTable
from contactsense.service.recordings.tables.parquet_tables import ParquetFolder, ParquetTable
from contactsense.service.recordings.tables.table import TableFile, reason


def open_table(path: Path) -> TableFile:
    """The table in a file or folder.

    Raises:
        RecordingError: It cannot be read, or is not a table.
    """
    check_name(path)
    try:
        if path.is_dir():
            return ParquetFolder(path)
        suffix = format_of(path)
        if suffix in (".yaml", ".yml"):
            raise RecordingError(
                f"{path}: expected a recording, got YAML; if it is a scene, --scene takes it beside a "
                "recording, and `contactsense scene show` shows it"
            )
        if suffix == ".parquet":
            return ParquetTable(path)
        if suffix in (".arrow", ".arrows", ".feather"):
            return ArrowTable(path)
        return CsvTable(path)
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot read the recording: {reason(error)}") from None
