"""The service's token, from the file that an option names."""

from pathlib import Path

SHORTEST = 16
"""Smallest number of characters of a token."""


class TokenError(ValueError):
    """A file has no token; the message is one line for a person and never contains what the file has."""


def check_token(token: str) -> str:
    """Return the token, if it is long enough and a header can carry it.

    Raises:
        ValueError: It is not; the message does not contain it.
    """
    if len(token) < SHORTEST:
        raise ValueError(f"expected a token of at least {SHORTEST} characters, got {len(token)}")
    if not (token.isascii() and token.isprintable()):
        raise ValueError("expected a token of letters, digits and signs of ASCII in one line")
    return token


def read_token(file: Path) -> str:
    """The token in a file.

    Raises:
        TokenError: The file cannot be read, or has no token.
    """
    try:
        token = file.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise TokenError(f"--token-file: {file} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise TokenError(f"--token-file: {file}: expected a token as text, got other bytes") from None
    try:
        return check_token(token)
    except ValueError as error:
        raise TokenError(f"--token-file: {file}: {error}") from None
