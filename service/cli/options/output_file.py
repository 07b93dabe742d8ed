"""Files that a command writes after long work."""

import os
from collections.abc import Iterable
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


def check_no_input(option: str, path: Path | None, inputs: Iterable[Path]) -> None:
    """Refuse to write over what the command reads.

    Args:
        option: That names the file, or the folder that it is in.
        path: The file; None: none is wanted.
        inputs: Files that the command reads.

    Raises:
        click.ClickException: It is one of them.
    """
    if path is None or not path.exists():
        return
    for one in inputs:
        if one.exists() and path.samefile(one):
            raise click.ClickException(f"{option}: expected another place than that of {one}, which is read")
