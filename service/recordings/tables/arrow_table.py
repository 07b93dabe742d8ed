"""Tables of numbers from Arrow IPC."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa

from contactsense.service.recordings.problems import Problem
from contactsense.service.recordings.tables.table import (
    Columns,
    floats,
    not_numeric,
    numeric,
    reason,
    text_metadata,
)

_ARROW = b"ARROW1"
"""The first bytes of an Arrow IPC file; a stream does not have them."""


class ArrowTable:
    """Arrow IPC: a stream, or the file format that pandas writes as Feather."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []
        self.rows: int | None = None
        with path.open("rb") as file:
            self._indexed = file.read(len(_ARROW)) == _ARROW
        with pa.OSFile(str(path)) as source:
            schema = self._open(source).schema
        self.names, self.others = numeric(schema), not_numeric(schema)
        self.meta = text_metadata(schema.metadata)

    def _open(self, source: pa.OSFile) -> Any:
        return pa.ipc.open_file(source) if self._indexed else pa.ipc.open_stream(source)

    def batches(
        self, names: list[str], first: int = 0, last: int | None = None
    ) -> Iterator[tuple[int, Columns]]:
        """As `TableFile.batches`."""
        self.problems.clear()
        row = 0
        with pa.OSFile(str(self._path)) as source, self._open(source) as opened:
            parts = map(opened.get_batch, range(opened.num_record_batches)) if self._indexed else opened
            source_batches = iter(parts)
            while True:
                try:
                    batch = next(source_batches)
                except StopIteration:
                    return
                except (OSError, pa.ArrowException) as error:
                    self.problems.append(Problem(row, row, "cut_short", _why_cut_short(error)))
                    return
                yield row, floats(batch, names)
                row += batch.num_rows


def _why_cut_short(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno is not None:  # none where Arrow expected more bytes
        return f"the rest cannot be read: {reason(error)}"
    return "the file ends within a batch"
