"""Means of residuals over windows: what their ages say of a contact that moves."""

import numpy as np
import pytest

from contactsense.residuals.observers import Observers
from contactsense.residuals.residual_ewma import ResidualEwma
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.tracking.contact_track import HOLD, WINDOWS, ContactTrack
from contactsense.tracking.window_averages import average_windows

DT, BANDWIDTH, SPEED = 0.002, 10.0, 0.04


@pytest.mark.parametrize(
    "forces",
    [np.full(300, 20.0), np.linspace(0.1, 40.0, 300), np.linspace(40.0, 5.0, 300)],
    ids=["constant", "rising", "falling"],
)
def test_the_age_of_a_window_says_where_a_sliding_contact_was(forces: np.ndarray) -> None:
    """Its mean is a force through the place at that age, also while the force rises or falls."""
    sizes = {"joints": 6, "link_sensors": 0, "links": 7}
    track, ewma, observers = (zeros(kind, **sizes) for kind in (ContactTrack, ResidualEwma, Observers))
    for i, force in enumerate(forces):
        place = SPEED * DT * i
        # A force along -z at (place, 0, 0), in the frame of the base.
        observers.base.residual[:6] = 0.0, 0.0, -force, 0.0, place * force, 0.0
        average_windows(track, ewma, observers, 0.06, 1, DT, BANDWIDTH)
        track.status[0].phase = HOLD
    newest = SPEED * DT * (len(forces) - 1)
    lag = track.windows[0].age
    assert lag == pytest.approx(1.0 / (2.0 * np.pi * BANDWIDTH))
    for i in range(1, WINDOWS):
        found = -track.mean[i, 4] / track.mean[i, 2]
        assert found < newest - 1e-4
        assert found == pytest.approx(newest - SPEED * (track.windows[i].age - lag), abs=1e-9)


def test_without_a_base_sensor_ages_are_those_of_the_samples() -> None:
    sizes = {"joints": 6, "link_sensors": 0, "links": 7}
    track, ewma, observers = (zeros(kind, **sizes) for kind in (ContactTrack, ResidualEwma, Observers))
    for _ in range(51):
        average_windows(track, ewma, observers, 0.06, 2, DT, BANDWIDTH)
        track.status[0].phase = HOLD
    expected = track.windows[0].age + DT * 25.0
    assert track.windows[WINDOWS - 1].age == pytest.approx(expected)
