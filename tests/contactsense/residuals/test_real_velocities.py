"""Velocities of a real arm have noise that a force/torque sensor under its base would not have."""

import numpy as np
import pytest

from tests.shared import shared

FILES = ("ur-20_02_05-20sec_8harm", "ur-20_02_10-30sec_12harm", "ur-20_02_19_15harm50sec")


def noise_of(name: str, stride: int) -> np.ndarray:
    """Standard deviation of each joint's velocity, as white noise of every `stride`th sample [rad/s].

    Fourth differences remove the motion and leave 70 times the variance of white noise; their median is
    robust against hard accelerations."""
    rows = np.loadtxt(shared("ur10e_recordings") / f"{name}.csv.gz", delimiter=",")[::stride]
    differences = np.abs(np.diff(rows[:, 7:13], 4, axis=0))
    return np.asarray(np.median(differences, axis=0) / 0.6745 / np.sqrt(70.0))


@pytest.mark.parametrize("name", FILES)
def test_velocities_of_a_real_ur10e_have_noise_of_a_milliradian_per_second(name: str) -> None:
    noise = noise_of(name, 1)
    assert (noise > 0.0005).all()
    assert (noise < 0.003).all()


@pytest.mark.parametrize("name", FILES)
def test_the_noise_of_samples_10_ms_apart_is_nearly_independent(name: str) -> None:
    """Noise that is correlated over many samples would be much larger in samples further apart."""
    ratio = noise_of(name, 2) / noise_of(name, 1)
    assert (ratio > 0.9).all()
    assert np.median(ratio) < 1.4
