"""Configures the log: text or JSON lines, to stderr or to files of bounded size."""

import json
import logging
import logging.handlers
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal

Level = Literal["debug", "info", "warning", "error"]
Format = Literal["text", "json"]

FILE_SIZE = 10_000_000
"""Size at which a log file is rotated [bytes]."""
FILES = 5
"""Number of rotated files that are kept."""
_BURST = 20
"""Maximum number of messages from one place in the code within a window; further ones are only counted."""
_WINDOW = 10.0
"""Length of that window [s]."""


class JsonFormatter(logging.Formatter):
    """One JSON object per line: time (UTC), level, logger, message, and the traceback if there is one."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as one line of JSON."""
        content = {
            "time": time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
            + f".{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            content["traceback"] = self.formatException(record.exc_info)
        return json.dumps(content)


class FloodFilter(logging.Filter):
    """Limits the messages from each place in the code within a window, then reports how many were suppressed:
    an attack must not fill the disk."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """`now` tells a time that does not go back [s]: where the host's clock is set back by hours, a window
        of that clock would last for hours."""
        super().__init__()
        self._now = now
        self._windows: dict[tuple[str, int], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is written."""
        place, now = (record.pathname, record.lineno), self._now()
        start, count = self._windows.get(place, (now, 0))
        if now - start > _WINDOW:
            if count > _BURST:
                record.msg = f"{record.getMessage()} ({count - _BURST} more like this were left out)"
                record.args = ()
            start, count = now, 0
        self._windows[place] = (start, count + 1)
        return count < _BURST


class LogFile(logging.handlers.RotatingFileHandler):
    """A log file of bounded size. What it does not take, as on a full disk, goes to stderr."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802
        """Write one line to stderr, not the traceback of the file."""
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            super().handleError(record)
            return
        # Part of the message, so that a line of JSON stays one.
        record.msg = f"{record.getMessage()} [not in {self.baseFilename}: {error.strerror}]"
        record.args = ()
        with suppress(OSError, ValueError):
            sys.stderr.write(f"{self.format(record)}\n")


def configure(level: Level = "info", form: Format = "text", path: Path | None = None) -> None:
    """Set up logging for the whole process.

    Args:
        level: Messages below this level are omitted.
        form: Text for people, or JSON.
        path: File to write to, rotated when it is full; None: stderr.

    Raises:
        OSError: The file cannot be written, or nothing else in its folder.
    """
    if path is None:
        handler: logging.Handler = logging.StreamHandler(sys.stderr)
    else:
        if path.is_file() or not path.exists():  # a device is not rotated
            _check_folder(path.parent)
        handler = LogFile(path, maxBytes=FILE_SIZE, backupCount=FILES)
    handler.setFormatter(
        JsonFormatter()
        if form == "json"
        else logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s")
    )
    handler.addFilter(FloodFilter())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)


def _check_folder(folder: Path) -> None:
    """Check that a full file can be rotated: else the log would end with it, months later."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        text = (
            f"expected a folder in which files can be made, as those that are full are kept: {error.strerror}"
        )
        raise OSError(error.errno, text) from None
