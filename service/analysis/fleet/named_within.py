"""Names of recordings in messages: those within the dataset, as reports are passed on."""

import re
from pathlib import Path


def named_within(message: str, path: Path, name: str) -> str:
    """The message with a recording, and the files in its folder, named within the dataset.

    Args:
        message: A message that may contain the path, as it was given, absolute, or with links resolved.
        path: Path of the recording.
        name: Its name within the dataset.
    """
    spellings = {str(path), str(path.absolute()), str(path.resolve())}
    either = "|".join(re.escape(spelling) for spelling in sorted(spellings, key=len, reverse=True))
    # Neither the end of another path nor the beginning of one.
    return re.sub(rf"(?<![\w./~-])(?:{either})(?!\.?[\w~-])", lambda _: name, message)
