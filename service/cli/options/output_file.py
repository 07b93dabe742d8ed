"""Files that a command writes after long work."""

import os
from pathlib import Path

import click


def check_writable(option: str, path: Path | None) -> None:
    """Refuse a file that cannot be written, before the work instead of after it.

    Args:
        option: That names the file.
        path: The file; None: none is wanted.

    Raises:
        click.ClickException: It is a folder, there is no folder for it, or writing is not permitted.
    """
    if path is None:
        return
    if path.is_dir():
        raise click.ClickException(f"{option}: expected a file, got the folder {path}")
    if not path.parent.is_dir():
        raise click.ClickException(f"{option}: {path}: there is no folder {path.parent}")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise click.ClickException(f"{option}: {path}: writing is not permitted")
