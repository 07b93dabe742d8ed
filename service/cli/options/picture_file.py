"""Pictures as files that options name, and errors of drawing them, each as one line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from contactsense.robots.extras import install_command


class PicturePath(click.Path):
    """A file whose name ends in .png, which is what is written."""

    def __init__(self) -> None:
        """The file need not exist."""
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path.

        Raises:
            click.BadParameter: Its name ends otherwise.
        """
        path = super().convert(value, param, ctx)
        assert isinstance(path, Path)
        if path.suffix.lower() != ".png":
            self.fail(f"expected a name that ends in .png, got {path}", param, ctx)
        return path


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
            f"pictures need the extra packages: {install_command('geometry')} ({error})"
        ) from None
    except OSError as error:
        raise click.ClickException(f"{path}: cannot write the picture: {error.strerror or error}") from None
