"""Velocities of a real arm have noise that a force/torque sensor under its base would not have."""

import numpy as np
import pytest

from tests.shared import shared

FILES = ("ur-20_02_05-20sec_8harm", "ur-20_02_10-30sec_12harm", "ur-20_02_19_15harm50sec")


@pytest.mark.parametrize("name", FILES)
def test_velocities_of_a_real_ur10e_have_noise_of_a_milliradian_per_second(name: str) -> None:
    """Fourth differences remove the motion and leave 70 times the variance of white noise; their median is
    robust against hard accelerations."""
    rows = np.loadtxt(shared("ur10e_recordings") / f"{name}.csv.gz", delimiter=",")
    differences = np.abs(np.diff(rows[:, 7:13], 4, axis=0))
    noise = np.median(differences, axis=0) / 0.6745 / np.sqrt(70.0)
    assert (noise > 0.0005).all()
    assert (noise < 0.003).all()
