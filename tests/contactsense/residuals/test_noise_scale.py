"""Noise larger than stated is followed, and neither contacts nor outliers are taken for it."""

import numpy as np
import pytest

from contactsense.residuals.noise_scale import NoiseScale, follow_noise, restart
from contactsense.robots.jit.flat_buffers import zeros

DT, JOINTS = 0.002, 6
STATED = np.full(JOINTS, 0.25)


def _followed(readings: np.ndarray, dt: float | np.ndarray = DT) -> np.ndarray:
    """Scale of the torques' noise after every reading, shape (N,)."""
    state, steps = zeros(NoiseScale, joints=JOINTS), np.broadcast_to(dt, len(readings)).copy()
    restart(state, np.eye(6))
    steps[0] = 0.0
    scales = []
    for reading, step in zip(readings, steps, strict=True):
        follow_noise(state, 1, state.torque_readings, reading, STATED, float(step))
        scales.append(state.noise[1].scale)
    return np.array(scales)


def _white(seconds: float, ratio: float = 1.0, dt: float = DT, seed: int = 0) -> np.ndarray:
    """Noise `ratio` times as large as stated, shape (N, JOINTS) [Nm]."""
    deviation = ratio * np.sqrt(STATED)
    return deviation * np.random.default_rng(seed).standard_normal((round(seconds / dt), JOINTS))


@pytest.mark.parametrize(("dt", "seconds"), [(0.002, 60.0), (0.01, 300.0)])
def test_noise_as_stated_is_left_alone(dt: float, seconds: float) -> None:
    """Chance exceeds four standard deviations in some moments of an hour."""
    assert np.mean(_followed(_white(seconds, dt=dt), dt) > 1.0) < 5e-3


@pytest.mark.parametrize("ratio", [1.4, 3.0, 20.0])
@pytest.mark.parametrize("dt", [0.002, 0.01])
def test_larger_noise_is_followed_within_two_seconds(ratio: float, dt: float) -> None:
    readings = np.concatenate((_white(5.0, dt=dt), _white(10.0, ratio, dt, seed=1)))
    followed = _followed(readings, dt)[round(7.0 / dt) :]
    assert np.sqrt(followed.mean()) == pytest.approx(ratio, rel=0.05)
    assert (np.sqrt(followed) > 0.75 * ratio).all()


def test_it_is_forgotten_when_the_noise_is_as_stated_again() -> None:
    readings = np.concatenate((_white(5.0, 5.0), _white(5.0, seed=1)))
    assert (_followed(readings)[round(9.0 / DT) :] == 1.0).all()


def test_contacts_and_motion_are_no_noise() -> None:
    """Gravity torques of a moving arm, a push of 0.2 s and one that is there from one sample to the next."""
    t = DT * np.arange(5000)
    torque = 50.0 * np.sin(2.0 * np.pi * 0.5 * t) + 30.0 * np.exp(-0.5 * ((t - 4.0) / 0.05) ** 2)
    torque += 40.0 * ((t > 7.0) & (t < 8.0))
    readings = _white(10.0) + torque[:, None]
    assert _followed(readings).max() < 1.25


def test_one_outlier_hardly_counts() -> None:
    readings = _white(5.0)
    readings[1500] += 300.0
    assert _followed(readings).max() < 1.25


def test_lost_samples_do_not_count() -> None:
    """Over a gap differences of a moving arm's torques are large."""
    t = DT * np.arange(10000)
    keep = np.random.default_rng(2).random(len(t)) > 0.1
    t = t[keep]
    readings = _white(20.0)[keep] + 50.0 * np.sin(2.0 * np.pi * t)[:, None]
    assert _followed(readings, np.diff(t, prepend=t[0] - DT)).max() < 1.25


def test_an_interval_that_changes_does_not_count() -> None:
    """Every fifth sample of a stream is lost, while the torques change fast and steadily."""
    t = DT * np.arange(10000)
    keep = np.arange(len(t)) % 5 != 4
    t = t[keep]
    readings = _white(20.0)[keep] + 80.0 * np.sin(2.0 * np.pi * 2.0 * t)[:, None]
    assert _followed(readings, np.diff(t, prepend=t[0] - DT)).max() < 1.25


def test_after_a_gap_the_readings_before_it_do_not_count() -> None:
    """A stream of eight samples at a time, in between which the load changes."""
    number = np.arange(round(10.0 / DT))
    readings = _white(10.0) + 100.0 * (number // 8 % 2)[:, None]
    steps = np.where(number % 8 == 0, 0.0, DT)
    assert _followed(readings, steps).max() < 1.25
