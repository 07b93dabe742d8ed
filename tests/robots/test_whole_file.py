"""A file that cannot be written whole is not there."""

import errno
from pathlib import Path

import pytest

from contactsense.robots.whole_file import whole_file


def _fill(path: Path) -> None:
    with whole_file(path) as unfinished:
        unfinished.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_an_error_leaves_the_file_before(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with whole_file(path) as unfinished:
        unfinished.write_text("before")
    with pytest.raises(OSError, match="No space"):
        _fill(path)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
