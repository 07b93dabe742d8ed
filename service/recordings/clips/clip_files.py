"""The files of clips in a folder, and what their metadata say."""

import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.service.recordings.metadata import PREFIX

CLIP, CONTINUOUS = "clip", "service"
"""First parts of the names of what a service writes: clips, and the files of a recording; and their tables'
names in the metadata."""
_ABANDONED = 3600.0
"""Nobody writes a clip for this long [s]."""


class ClipFile(NamedTuple):
    """What a file says of its clip."""

    reason: str
    """Why it was asked for."""
    samples: int
    """Samples in it."""


def clip_names(folder: Path) -> list[str]:
    """Names of the clips in a folder, the oldest first; none if there is no such folder."""
    return sorted(path.name for path in folder.glob(f"{CLIP}-*.parquet"))


def remove_unfinished(folder: Path) -> None:
    """Remove what writers of clips have left that were killed meanwhile: the limit of disk space does not
    count it."""
    for file in folder.glob(f".{CLIP}-*.parquet.*"):
        with suppress(OSError):
            if time.time() - file.stat().st_mtime > _ABANDONED:
                file.unlink()


def read_clip_file(path: Path) -> ClipFile:
    """Read the metadata of a clip.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is no Parquet file.
    """
    try:
        with pa_parquet.ParquetFile(path) as file:
            entries = file.schema_arrow.metadata or {}
            reason = entries.get(f"{PREFIX}reason".encode(), b"")
            return ClipFile(reason.decode("utf-8", "replace"), file.metadata.num_rows)
    except pa.ArrowException as error:
        raise ValueError(f"cannot be read as Parquet: {error}") from None
