"""Clips that a service has written while it was recording: their samples are in the recording, too."""

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.service.recordings.clips.clip_files import CLIP, CONTINUOUS

_TIME = "host_time"
_JOINED = 0.5
"""Files of a recording with less time than this between them are one stretch [s]."""


def without_repeated_clips(files: Iterable[Path]) -> list[Path]:
    """The files in their order, without clips that a recording in the same folder contains as a whole.

    Args:
        files: Paths of files, of all kinds.
    """
    kept, folders = list(files), defaultdict(list)
    with_clips = {file.parent for file in kept if _is_of(file, CLIP)}
    for file in kept:
        if file.parent in with_clips and _is_of(file, CONTINUOUS):
            folders[file.parent].append(file)
    recorded = {folder: _stretches(inside) for folder, inside in folders.items()}
    return [file for file in kept if not (_is_of(file, CLIP) and _is_within(file, recorded))]


def _is_of(file: Path, kind: str) -> bool:
    return file.suffix == ".parquet" and file.name.startswith(f"{kind}-")


def _is_within(clip: Path, recorded: dict[Path, list[tuple[float, float]]]) -> bool:
    stretches = recorded.get(clip.parent)
    span = _span(clip) if stretches else None
    if not stretches or span is None:
        return False
    return any(first <= span[0] and span[1] <= last for first, last in stretches)


def _stretches(files: list[Path]) -> list[tuple[float, float]]:
    """First and last time of each stretch that the files cover without a pause."""
    stretches: list[tuple[float, float]] = []
    for first, last in sorted(span for span in map(_span, files) if span is not None):
        if stretches and first <= stretches[-1][1] + _JOINED:
            first, last = stretches[-1][0], max(last, stretches.pop()[1])
        stretches.append((first, last))
    return stretches


def _span(file: Path) -> tuple[float, float] | None:
    """First and last time in a file [s since 1970], from its statistics; None where they cannot be read."""
    try:
        meta = pa_parquet.read_metadata(file)
        schema = meta.schema.to_arrow_schema()
        column = schema.get_field_index(_TIME)
        if column < 0 or not pa.types.is_floating(schema.field(column).type):  # of another program
            return None
        groups = [meta.row_group(i).column(column).statistics for i in range(meta.num_row_groups)]
    except (OSError, pa.ArrowException):
        return None
    if not groups or not all(group is not None and group.has_min_max for group in groups):
        return None
    return min(group.min for group in groups), max(group.max for group in groups)
