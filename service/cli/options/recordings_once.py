"""Recordings as arguments of a command."""

from pathlib import Path

import click


def each_once(_: click.Context, __: click.Parameter, files: tuple[Path, ...]) -> tuple[Path, ...]:
    """The files, as the callback of an argument.

    Raises:
        click.UsageError: A file is named twice, as by `a.csv *.csv`: its samples would count twice, and
            standard deviations be too small.
    """
    for i, file in enumerate(files):
        if file.resolve() in [other.resolve() for other in files[:i]]:
            raise click.UsageError(f"{file}: expected each recording once, got it twice")
    return files
