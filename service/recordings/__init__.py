"""Recordings: tables of samples on disk."""

from contactsense.service.recordings.column_mapping import ColumnMapping, MappingError
from contactsense.service.recordings.problems import Problem, RecordingError
from contactsense.service.recordings.recording import Recording
from contactsense.service.recordings.recording_file import RecordingFile, read, scene_in

__all__ = [
    "ColumnMapping",
    "MappingError",
    "Problem",
    "Recording",
    "RecordingError",
    "RecordingFile",
    "read",
    "scene_in",
]
