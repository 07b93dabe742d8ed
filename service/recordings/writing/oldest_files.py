"""Removes the oldest files of a kind in a folder, so that they take a limited space on the disk."""

import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_LOG = logging.getLogger("contactsense")


class OldestFiles:
    """The files of one kind in a folder, by age.

    Their names begin with the host's time, which may be set back. So a file that is written here is newer
    than all that were there before it, whatever their names say.

    Args:
        folder: Where they are.
        prefix: First part of their names.
        limit: Space that they may take [bytes].
        warn: Told once of each file that cannot be removed. It is not counted any more: the files that can
            be removed would have to make room for it.
    """

    def __init__(
        self, folder: Path, prefix: str, limit: int, warn: Callable[[str], None] = _LOG.warning
    ) -> None:
        self._folder, self._pattern, self._limit = folder, f"{prefix}-*.parquet", limit
        self._warn = warn
        self._not_removed: set[str] = set()
        self._later: dict[str, tuple[str, int]] = {}
        """Name of a file that is newer than its name says -> its place in the order of age."""

    def remove(self, written: Path) -> list[Path]:
        """Remove the oldest files until the others take at most the limit, and return them.

        Args:
            written: The file that was written last; it is kept.
        """
        others = [file for file in self._folder.glob(self._pattern) if file.name != written.name]
        newest = max(map(self._age, others), default=("", 0))
        if (written.name, 0) < newest:
            self._later[written.name] = newest[0], newest[1] + 1
        sizes = {file: _size(file) for file in others}
        taken = sum(sizes.values()) + _size(written)
        removed = []
        for file in sorted(others, key=self._age):
            if taken <= self._limit:
                break
            if self._unlink(file):
                removed.append(file)
            taken -= sizes[file]
        left = {file.name for file in others} - {file.name for file in removed} | {written.name}
        self._later = {name: age for name, age in self._later.items() if name in left}
        return removed

    def _unlink(self, file: Path) -> bool:
        """Remove a file; returns False if it cannot be removed."""
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            if file.name not in self._not_removed:
                self._warn(
                    f"{file} cannot be removed, and is not counted in the disk space that such files may "
                    f"take: {error.strerror}"
                )
            self._not_removed.add(file.name)
            return False
        return True

    def _age(self, file: Path) -> tuple[str, int]:
        return self._later.get(file.name, (file.name, 0))


def _size(file: Path) -> int:
    """Bytes in a file; another program may have removed it."""
    with suppress(FileNotFoundError):
        return file.stat().st_size
    return 0
