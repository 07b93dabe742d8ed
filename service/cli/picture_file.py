"""Errors of drawing a picture into a file, each as one line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click


@contextmanager
def picture_file(path: Path) -> Iterator[None]:
    """Import what draws, and draw into `path`, within this `with` block.

    Raises:
        click.ClickException: the packages for pictures are missing, or the file cannot be written.
    """
    try:
        yield
    except ImportError as error:
        raise click.ClickException(
            f"pictures need the extra packages: pip install contactsense[geometry] ({error})"
        ) from None
    except OSError as error:
        raise click.ClickException(f"{path}: cannot write the picture: {error.strerror or error}") from None
