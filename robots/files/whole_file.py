"""Files that are there whole or not at all: no reader sees an incomplete one, also where the disk is full."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_IN_PLACE_ONLY = (errno.EACCES, errno.EPERM, errno.EBUSY)
"""Errors where the folder may not be changed, as with a single file that is mounted into a container."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to: what is there at the end of the block replaces `path`; after an error
    it is removed."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield unfinished
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a file of the user's own, such as a scene: it keeps its mode, and a link stays one.

    Raises:
        OSError: It cannot be written, with its path as `filename`. What was there before is still there,
            unless the folder may not be changed, so that the file itself had to be.
    """
    target = path.resolve()
    try:
        # Where the folder may be changed, a file that may not be would be replaced.
        if target.exists() and not (target.is_file() and os.access(target, os.W_OK)):
            target.write_text(text, encoding="utf-8")
            return
        try:
            with whole_file(target) as unfinished:
                unfinished.write_text(text, encoding="utf-8")
                if target.exists():
                    shutil.copymode(target, unfinished)
        except OSError as error:
            if error.errno not in _IN_PLACE_ONLY or not target.exists():
                raise
            target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
