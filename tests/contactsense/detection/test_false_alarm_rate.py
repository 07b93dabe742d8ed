"""Alarms come as seldom as stated: the law for filtered noise, held against simulated noise."""

import numpy as np
import pytest

from contactsense.detection.false_alarm_rate import (
    false_alarms_per_hour,
    onset_threshold,
    release_threshold,
    sample_threshold,
)
from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    advance,
    empty_observer,
    start_step,
)
from contactsense.robots.jit.kernel import kernel


@kernel
def _alarms(
    state: MomentumObserver,
    noise: np.ndarray,
    dt: float,
    bandwidth: float,
    onset: float,
    release: float,
    on: bool,
) -> tuple[int, bool]:
    """Onsets in noise, shape (samples, degrees_of_freedom), by the rule of `contactsense.runtime.kernels`."""
    count = 0
    above = False
    for i in range(noise.shape[0]):
        step = start_step(state, dt, bandwidth)
        energy = 0.0
        for k in range(noise.shape[1]):
            advance(state, k, 0.0, noise[i, k], step)
            energy += 0.5 * state.residual[k] ** 2
        energy /= state.history[0].variance_ratio
        if on:
            on = energy > release
        elif energy > onset and above:
            on = True
            count += 1
        above = energy > onset
    return count, on


@pytest.mark.parametrize(
    ("degrees_of_freedom", "bandwidth", "dt"), [(12, 10.0, 0.002), (6, 25.0, 0.002), (12, 10.0, 0.008)]
)
def test_noise_alone_alarms_as_often_as_stated(degrees_of_freedom: int, bandwidth: float, dt: float) -> None:
    """40 an hour over 5 h: 200 expected, known to 7 %; the law is good to about a third."""
    per_hour, hours = 40.0, 5.0
    onset, release = (
        onset_threshold(per_hour, degrees_of_freedom, bandwidth, dt),
        release_threshold(degrees_of_freedom),
    )
    chance, state, on, count = np.random.default_rng(5), empty_observer(degrees_of_freedom), False, 0
    start_step(state, 0.0, bandwidth)
    for i in range(round(hours * 3600.0 / dt / 60_000) + 1):
        alarms, on = _alarms(
            state, chance.standard_normal((60_000, degrees_of_freedom)), dt, bandwidth, onset, release, on
        )
        count += alarms if i > 0 else 0
    assert 0.67 * per_hour * hours < count < 1.5 * per_hour * hours


def test_the_threshold_inverts_the_false_alarm_rate() -> None:
    for per_hour in (1e-3, 0.1, 10.0):
        for degrees_of_freedom in (6, 12, 18):
            found = onset_threshold(per_hour, degrees_of_freedom, 10.0, 0.002)
            assert false_alarms_per_hour(found, degrees_of_freedom, 10.0, 0.002) == pytest.approx(
                per_hour, rel=1e-9
            )
            assert found > release_threshold(degrees_of_freedom)


def test_fewer_alarms_and_faster_observers_need_higher_thresholds() -> None:
    assert onset_threshold(0.01, 12, 10.0, 0.002) > onset_threshold(1.0, 12, 10.0, 0.002)
    assert onset_threshold(0.01, 12, 30.0, 1e-5) > onset_threshold(
        0.01, 12, 3.0, 1e-5
    )  # where samples slip over nothing
    assert sample_threshold(0.01, 12, 10.0) < onset_threshold(
        0.01, 12, 10.0, 0.002
    )  # a stream has many looks
