"""The list of a recording's contacts to jump to."""

from contactsense import Event
from contactsense.service.viewer.recorded_source import onset_times


def test_contacts_that_begin_at_nearly_the_same_time_are_both_listed() -> None:
    events = [
        Event("onset", 1, 2.01, "forearm"),
        Event("hold", 1, 2.02, "forearm"),
        Event("release", 1, 2.03, "forearm"),
        Event("onset", 2, 2.04, "forearm"),
    ]
    assert onset_times(events) == {"1: 2.0 s forearm": 2.01, "2: 2.0 s forearm": 2.04}
