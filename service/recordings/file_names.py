"""Names of files that tables can have."""

import os
import sys
from pathlib import Path

from contactsense.service.recordings.problems import RecordingError


def check_name(path: Path) -> None:
    """Check that a path is UTF-8 and is read as such. Arrow opens no other one, and no table or report can
    contain its name.

    Raises:
        RecordingError: It is not; the message says whether the name or the locale is the cause.
    """
    raw = os.fsencode(path)
    if raw == str(path).encode("utf-8", "replace"):
        return
    name = raw.decode("utf-8", "backslashreplace")
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        raise RecordingError(f"{name}: expected a name in UTF-8: rename it") from None
    raise RecordingError(
        f"{name}: names are read as {sys.getfilesystemencoding()} here, expected UTF-8: set LC_ALL=C.UTF-8"
    )


def check_there(path: Path) -> None:
    """Check that there is a file or folder of this name: readers of the formats say so in other words, or of
    the parts that they look for.

    Raises:
        RecordingError: There is none.
    """
    if not path.exists():
        raise RecordingError(f"{path}: cannot read the recording: No such file or directory")
