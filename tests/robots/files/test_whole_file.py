"""A file that cannot be written whole is not there."""

import errno
import os
from pathlib import Path

import pytest

from contactsense.robots.files.whole_file import whole_file, write_text


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


def test_a_text_keeps_its_mode_and_its_link(tmp_path: Path) -> None:
    path, link = tmp_path / "scene.yaml", tmp_path / "link.yaml"
    write_text(path, "before")
    path.chmod(0o640)
    link.symlink_to(path)
    write_text(link, "after")
    assert link.is_symlink()
    assert path.read_text() == "after"
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_full_disk_leaves_the_text_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.yaml"
    write_text(path, "before")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space") as found:
        write_text(path, "after")
    assert found.value.filename == str(path)
    assert path.read_text() == "before"


def test_a_text_in_a_folder_that_may_not_be_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("before")

    def refused(*_: object) -> None:
        raise OSError(errno.EBUSY, "Device or resource busy")

    monkeypatch.setattr(os, "replace", refused)
    write_text(path, "after")
    assert path.read_text() == "after"
    assert list(tmp_path.iterdir()) == [path]


def test_a_device_is_written_to() -> None:
    write_text(Path("/dev/null"), "text")
    assert Path("/dev/null").is_char_device()


def test_a_file_that_may_not_be_written_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is written to as it is, which the system refuses to all but root."""
    path = tmp_path / "scene.yaml"
    path.write_text("before")
    kept = path.stat().st_ino
    monkeypatch.setattr(os, "access", lambda *_: False)
    write_text(path, "after")
    assert path.stat().st_ino == kept
