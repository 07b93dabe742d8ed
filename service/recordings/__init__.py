"""Recordings: tables of samples on disk.

Reading: `table_files` and `bag_files` give tables, `signal_columns` finds the signals in their columns,
`cleaning`, `held_values` and `velocity_agreement` check them, `recording_file` converts them block by block,
`sensor_delays` takes the delays off, and a `recording` holds the result. What is wrong is a `Problem` of a
row. Writing: `recorder` and `clip_listener` through `segment_writer`, and `export` for other programs.
"""

from contactsense.service.recordings.column_mapping import ColumnMapping, MappingError
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.recording import Recording
from contactsense.service.recordings.recording_file import RecordingFile, date_in, read, scene_in

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
