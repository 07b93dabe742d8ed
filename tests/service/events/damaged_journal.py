"""A journal in whose file some pages were overwritten, as by a disk that fails."""

from pathlib import Path

from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.events.model import ContactEvent

_PAGE = 4096


def damaged_journal(folder: Path) -> Path:
    """A file in which some of the older events cannot be read; what is written into it can."""
    path = folder / "j.db"
    with Journal(JournalSettings(path=path)) as journal:
        for n in range(3000):
            journal.append(ContactEvent(kind="onset", contact=n))
    content = bytearray(path.read_bytes())
    middle = len(content) // _PAGE // 2 * _PAGE
    content[middle : middle + 8 * _PAGE] = 8 * _PAGE * b"\xa5"
    path.write_bytes(content)
    return path
