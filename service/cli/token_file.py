"""The token of a running service, from the file that an option names."""

from pathlib import Path

import click


def read_token(file: Path | None) -> str | None:
    """The token; None without a file.

    Raises:
        click.ClickException: The file cannot be read.
    """
    if file is None:
        return None
    try:
        return file.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise click.ClickException(f"--token-file: {file}: {error.strerror}") from None
