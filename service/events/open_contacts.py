"""Contacts that have begun and not ended, so that each gets a release, also if nobody saw its end."""

from contextlib import suppress

from pydantic import ValidationError

from contactsense.service.events.journal import Journal
from contactsense.service.events.model import ContactEvent, Kind

_BEGUN: tuple[Kind, ...] = ("onset", "hold", "slide", "resume")
_ENDED: tuple[Kind, ...] = ("release", "weight")
_RECENT = 1000
"""Number of latest events of contacts in which those are sought that an earlier service left open."""


class OpenContacts:
    """The contacts of one stream; numbers begin again with each process that estimates.

    Args:
        journal: The journal; contacts that the service before has left open in it are open.
    """

    def __init__(self, journal: Journal) -> None:
        self._latest: dict[int, ContactEvent] = {}
        for body in journal.latest(_RECENT, (*_BEGUN, *_ENDED)):
            with suppress(ValidationError):  # of a later version, or damaged
                self.note(ContactEvent.model_validate_json(body))

    def note(self, event: ContactEvent) -> None:
        """Take note of the next event of the journal."""
        if event.kind in _BEGUN:
            self._latest[event.contact] = event
        elif event.kind in _ENDED:
            self._latest.pop(event.contact, None)

    def end(self, who: str, time: str) -> list[ContactEvent]:
        """Return a release of each open contact, with the summary of its latest event.

        Args:
            who: What has ended, so that nobody saw the end of the contacts.
            time: Time on the host's clock, ISO 8601 in UTC.
        """
        reason = f"{who} ended; the end of the contact was not seen"
        return [
            event.model_copy(update={"id": 0, "kind": "release", "time": time, "reason": reason})
            for event in self._latest.values()
        ]
