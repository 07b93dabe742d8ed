"""The controls of a recording: the list of its contacts to jump to, and the slider."""

import pytest

from contactsense import Event
from contactsense.service.viewer.recorded_source import onset_times, slider_end


def test_contacts_that_begin_at_nearly_the_same_time_are_both_listed() -> None:
    events = [
        Event("onset", 1, 2.01, "forearm"),
        Event("hold", 1, 2.02, "forearm"),
        Event("release", 1, 2.03, "forearm"),
        Event("onset", 2, 2.04, "forearm"),
    ]
    assert onset_times(events) == {"1: 2.0 s forearm": 2.01, "2: 2.0 s forearm": 2.04}


@pytest.mark.parametrize(
    ("duration", "end"), [(0.0, 0.01), (0.002, 0.01), (25.998, 26.0), (26.0, 26.0), (3639.998, 3640.0)]
)
def test_the_slider_reaches_the_end_of_the_recording(duration: float, end: float) -> None:
    assert slider_end(duration) == end
