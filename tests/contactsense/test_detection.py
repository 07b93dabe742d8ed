"""Alarms come as seldom as stated: the law for filtered noise, held against simulated noise."""

import numpy as np
import pytest

from contactsense.detection import alarms_per_hour, level, release_level, single_level
from contactsense.observer import GAIN, Observer, advance, begin, empty_observer
from robots.compiled import kernel


@kernel
def _alarms(  # type: ignore[no-untyped-def]
    state: Observer, noise, dt: float, bandwidth: float, onset: float, release: float, on: bool
):
    """Contacts that begin in noise of shape (samples, freedom), as `contactsense.entry.listen` decides."""
    count = 0
    above = False
    for i in range(noise.shape[0]):
        step = begin(state, dt, bandwidth)
        energy = 0.0
        for k in range(noise.shape[1]):
            advance(state, k, 0.0, noise[i, k], step)
            energy += 0.5 * state.residual[k] ** 2
        energy /= state.clock[GAIN]
        if on:
            on = energy > release
        elif energy > onset and above:
            on = True
            count += 1
        above = energy > onset
    return count, on


@pytest.mark.parametrize(
    ("freedom", "bandwidth", "dt"), [(12, 10.0, 0.002), (6, 25.0, 0.002), (12, 10.0, 0.008)]
)
def test_noise_alone_alarms_as_often_as_stated(freedom: int, bandwidth: float, dt: float) -> None:
    """40 an hour over 5 h: 200 expected, known to 7 %; the law is good to about a third."""
    per_hour, hours = 40.0, 5.0
    onset, release = level(per_hour, freedom, bandwidth, dt), release_level(freedom)
    chance, state, on, count = np.random.default_rng(5), empty_observer(freedom), False, 0
    begin(state, 0.0, bandwidth)
    for i in range(round(hours * 3600.0 / dt / 60_000) + 1):
        alarms, on = _alarms(
            state, chance.standard_normal((60_000, freedom)), dt, bandwidth, onset, release, on
        )
        count += alarms if i > 0 else 0
    assert 0.67 * per_hour * hours < count < 1.5 * per_hour * hours


def test_the_level_is_the_inverse_of_the_rate() -> None:
    for per_hour in (1e-3, 0.1, 10.0):
        for freedom in (6, 12, 18):
            found = level(per_hour, freedom, 10.0, 0.002)
            assert alarms_per_hour(found, freedom, 10.0, 0.002) == pytest.approx(per_hour, rel=1e-9)
            assert found > release_level(freedom)


def test_fewer_alarms_and_faster_observers_need_higher_levels() -> None:
    assert level(0.01, 12, 10.0, 0.002) > level(1.0, 12, 10.0, 0.002)
    assert level(0.01, 12, 30.0, 1e-5) > level(0.01, 12, 3.0, 1e-5)  # where samples slip over nothing
    assert single_level(0.01, 12, 10.0) < level(0.01, 12, 10.0, 0.002)  # a stream has many looks
