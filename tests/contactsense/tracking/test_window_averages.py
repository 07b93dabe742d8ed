"""Means of residuals over windows: what their ages say of a contact that moves."""

import numpy as np
import pytest

from contactsense.residuals.observers import Observers
from contactsense.residuals.residual_ewma import ResidualEwma
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.tracking.contact_track import HOLD, WINDOWS, ContactTrack
from contactsense.tracking.window_averages import average_windows, restart_windows

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


K = 2.0 * np.pi * BANDWIDTH
RATIO = 0.06
"""Variance of a residual over that of one sample's white noise."""


def _parts() -> tuple[ContactTrack, ResidualEwma, Observers]:
    sizes = {"joints": 6, "link_sensors": 0, "links": 7}
    return zeros(ContactTrack, **sizes), zeros(ResidualEwma, **sizes), zeros(Observers, **sizes)


def _averaged(residuals: np.ndarray) -> ContactTrack:
    """After these residuals of the first component of the base wrench."""
    track, ewma, observers = _parts()
    for value in residuals:
        observers.base.residual[0] = value
        average_windows(track, ewma, observers, RATIO, 1, DT, BANDWIDTH)
        track.status[0].phase = HOLD
    return track


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_the_noise_of_a_mean_is_that_of_its_weights(count: int) -> None:
    """The residuals' noise is that of a first-order low-pass: its correlation decays with the observer's."""
    track = _averaged(np.ones(count))
    weights = np.array([_averaged(impulse).mean[:, 0] for impulse in np.eye(count)])
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    correlation = np.exp(-K * DT * apart)
    np.testing.assert_allclose(track.mean[:, 0], 1.0)
    for i in range(WINDOWS):
        w, window = weights[:, i], track.windows[i]
        assert window.variance_ratio == pytest.approx(RATIO * w @ correlation @ w)
        assert window.residual_covariance == pytest.approx(RATIO * w @ correlation[-1])


def test_each_window_is_three_times_as_long_as_the_one_before_and_the_last_one_unbounded() -> None:
    count = 2000
    newest = _averaged(np.eye(count)[-1]).mean[:, 0]
    assert newest[0] == 1.0
    for i in range(1, WINDOWS - 1):
        assert newest[i] == pytest.approx(max(DT * K / 3.0**i, 1.0 / count))
    assert newest[WINDOWS - 1] == pytest.approx(1.0 / count)


def test_a_sustained_contact_begins_with_the_average_that_showed_it() -> None:
    track, ewma, observers = _parts()
    observers.base.residual[0], ewma.mean[0] = 5.0, 2.0
    average = ewma.status[0]
    average.samples, average.age = 40.0, 0.3
    average.variance_ratio, average.residual_covariance = 0.01, 0.02
    track.status[0].sustained = True
    average_windows(track, ewma, observers, RATIO, 1, DT, BANDWIDTH)
    assert track.mean[:, 0].tolist() == [5.0, *[2.0] * (WINDOWS - 1)]
    for i in range(1, WINDOWS):
        window = track.windows[i]
        assert (window.samples, window.age) == (40.0, 0.3)
        assert (window.variance_ratio, window.residual_covariance) == (0.01, 0.02)


@pytest.mark.parametrize("by_sensors", [True, False])
def test_after_a_change_of_contact_or_of_the_sensors_windows_hold_the_newest_residual(
    by_sensors: bool,
) -> None:
    track, ewma, observers = _parts()
    for value in (1.0, 2.0, 3.0):
        observers.base.residual[0] = value
        average_windows(track, ewma, observers, RATIO, 1, DT, BANDWIDTH)
        track.status[0].phase = HOLD
    track.link_weight[:] = 1.0
    if by_sensors:
        observers.base.residual[0] = 3.5
        average_windows(track, ewma, observers, RATIO, 3, DT, BANDWIDTH)
    else:
        restart_windows(track)
        assert not track.link_weight.any()
    assert track.mean[:, 0].tolist() == [3.5 if by_sensors else 3.0] * WINDOWS
    for i in range(1, WINDOWS):
        window = track.windows[i]
        assert (window.samples, window.age) == (1.0, track.windows[0].age)
        assert window.variance_ratio == window.residual_covariance == RATIO
