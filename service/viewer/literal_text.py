"""Text of others as Markdown: names, file names, errors. viser shows Markdown with the HTML in it."""

import re

_CODE = re.compile(r"(`[^`\n]+`)")
_SPECIAL = re.compile(r"[\\`*<>&|\[\]~$]|(?<![^\W_])_|_(?![^\W_])")


def literal(text: str) -> str:
    """Markdown that shows a text as it is; what stands between backticks, such as a command, is code."""
    parts = _CODE.split(text)
    parts[::2] = [_SPECIAL.sub(r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts)
