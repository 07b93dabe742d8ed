"""A disk that does not give back what was written."""

import errno
import os

import pyarrow as pa
import pytest


class _FailingFile:
    """A file that can be read up to some byte."""

    def __init__(self, path: str, good: int) -> None:
        self._file, self._good = open(path, "rb"), good  # noqa: SIM115

    def read(self, size: int) -> bytes:
        if self._file.tell() + size > self._good:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return self._file.read(size)

    @property
    def closed(self) -> bool:
        return self._file.closed

    def close(self) -> None:
        self._file.close()


def fail_reading(monkeypatch: pytest.MonkeyPatch, good: int) -> None:
    """Arrow can read the first `good` bytes of each file that it opens from now on; the rest is an error of
    the disk."""
    real = pa.OSFile

    def opened(path: str, mode: str = "rb") -> pa.NativeFile:
        return real(path, mode) if mode == "wb" else pa.PythonFile(_FailingFile(path, good), "r")

    monkeypatch.setattr(pa, "OSFile", opened)
