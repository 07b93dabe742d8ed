"""The format of a recording's file, which its name tells."""

from pathlib import Path


def format_of(path: Path) -> str:
    """The ending of the name, in small letters, as some programs write names in capitals: `.csv`."""
    return path.suffix.lower()
