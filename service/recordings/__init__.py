"""Recordings: tables of samples on disk.

Reading: `tables` and `ros` give tables, `signals` finds and checks the signals in their columns,
`recording_file` converts them block by block, and a `recording` holds the result. What is wrong is a
`Problem` of a row. Writing: `writing` for live samples, with `clips` of them, and `export` for other
programs.
"""

from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.recording import Recording
from contactsense.service.recordings.recording_file import RecordingFile, date_in, read, scene_in
from contactsense.service.recordings.signals.column_mapping import ColumnMapping, MappingError

__all__ = [
    "ColumnMapping",
    "MappingError",
    "Problem",
    "Recording",
    "RecordingError",
    "RecordingFile",
    "date_in",
    "read",
    "scene_in",
]
