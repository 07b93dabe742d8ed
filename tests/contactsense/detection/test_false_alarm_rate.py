"""Alarms come as seldom as stated: the law for filtered noise, held against simulated noise."""

import itertools

import numpy as np
import pytest
from scipy.stats import chi, chi2

from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.detection.detectable_force import detectable_force
from contactsense.detection.false_alarm_rate import (
    false_alarms_per_hour,
    onset_threshold,
    release_threshold,
    sample_threshold,
)
from contactsense.detection.thresholds import (
    STEPS,
    degrees_of_freedom_of,
    sensor_set,
    stream_thresholds,
    threshold_index,
)
from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    advance,
    empty_observer,
    start_step,
)
from contactsense.residuals.residual_ewma import RELATIVE_BANDWIDTH
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


@pytest.mark.slow
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


@pytest.mark.parametrize("degrees_of_freedom", [1, 6, 18])
@pytest.mark.parametrize("energy", [12.0, 25.0])
def test_the_rate_of_a_continuous_process_is_the_flux_at_the_level(
    degrees_of_freedom: int, energy: float
) -> None:
    """The length R of an Ornstein-Uhlenbeck process of correlation time 1 / K crosses a high level at the
    rate -K dp/dR, with p the density of a chi distribution."""
    bandwidth, dt, step = 10.0, 1e-14, 1e-4
    radius = np.sqrt(2.0 * energy)
    density = chi(degrees_of_freedom).pdf
    slope = (density(radius + step) - density(radius - step)) / (2.0 * step)
    expected = -3600.0 * 2.0 * np.pi * bandwidth * slope
    found = false_alarms_per_hour(energy, degrees_of_freedom, bandwidth, dt)
    assert found == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("degrees_of_freedom", [1, 12])
def test_single_measurements_are_as_many_as_a_stream_decides_independently(degrees_of_freedom: int) -> None:
    per_hour, bandwidth = 0.5, 10.0
    energy = sample_threshold(per_hour, degrees_of_freedom, bandwidth)
    decisions_per_hour = 3600.0 * 2.0 * np.pi * bandwidth
    assert chi2(degrees_of_freedom).sf(2.0 * energy) * decisions_per_hour == pytest.approx(per_hour)


def test_noise_alone_exceeds_the_release_threshold_in_one_sample_of_a_hundred() -> None:
    squares = np.random.default_rng(0).chisquare(12, 400_000)
    assert np.mean(0.5 * squares > release_threshold(12)) == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("has_base", [False, True])
def test_each_link_sensor_adds_six_residuals(has_base: bool) -> None:
    assert degrees_of_freedom_of(7, (True, True, 0b1011)) == 6 + 7 + 18
    assert degrees_of_freedom_of(7, (False, True, 0)) == 7
    sensors = tuple(LinkWrenchSensor(name=name, link=name) for name in ("forearm", "wrist_1"))
    base = WrenchSensor() if has_base else None
    scene = Scene(robot="ur5e", base_wrench=base, link_wrenches=sensors)
    table = stream_thresholds(scene)
    for used in itertools.product((False, True), (False, True), (0b00, 0b10, 0b11)):
        degrees = degrees_of_freedom_of(6, used)
        row = table[sensor_set(*used), threshold_index(0.004)]
        per_hour, average = scene.false_alarms_per_hour, np.inf
        if not has_base:
            # Two tests look for a contact, each with half of the false alarms.
            per_hour /= 2.0
            average = onset_threshold(per_hour, degrees, RELATIVE_BANDWIDTH * scene.bandwidth, 0.004)
        onset = onset_threshold(per_hour, degrees, scene.bandwidth, 0.004)
        np.testing.assert_allclose(row, (onset, release_threshold(degrees), average))


@pytest.mark.parametrize("rate", [250, 500, 1000, 2000, 4000, 8000])
def test_the_threshold_of_a_stream_is_that_of_its_rate(rate: int) -> None:
    scene = Scene(robot="ur5e", joint_torque=None)
    expected = onset_threshold(scene.false_alarms_per_hour, 6, scene.bandwidth, 1.0 / rate)
    row = stream_thresholds(scene)[sensor_set(True, False, 0)]
    for jitter in (0.9, 1.0, 1.1):
        assert row[threshold_index(jitter / rate), 0] == pytest.approx(expected, abs=0.15)
    assert row[threshold_index(1.0 / rate), 0] == pytest.approx(expected)


def test_sample_times_beyond_the_table_and_unknown_ones_have_thresholds() -> None:
    assert threshold_index(1e-9) == 0
    assert threshold_index(5.0) == STEPS - 1
    assert threshold_index(0.0) == threshold_index(0.001)


def test_the_detectable_force_is_that_of_the_worst_direction() -> None:
    spread = np.random.default_rng(1).standard_normal((3, 3))
    covariance = spread @ spread.T
    directions = np.random.default_rng(2).standard_normal((20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    # With the least favourable moment a force F along f has the squared length F^2 f' inv(S) f.
    squares = np.einsum("ni,ij,nj->n", directions, np.linalg.inv(covariance), directions)
    worst = 5.0 / np.sqrt(squares.min())
    found = detectable_force(5.0, covariance)
    assert worst <= found <= 1.01 * worst
