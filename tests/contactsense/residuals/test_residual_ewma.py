"""The average of the residuals: its noise as simulated, its start, and what makes it start again."""

import math

import numpy as np
import pytest

from contactsense.residuals.observers import Observers
from contactsense.residuals.residual_ewma import (
    NOISE_SHARE,
    RELATIVE_BANDWIDTH,
    ResidualEwma,
    restart_ewma,
    share_in_average,
    update_ewma,
)
from contactsense.robots.jit.flat_buffers import zeros

JOINTS, BANDWIDTH, DT, VARIANCE, SENSORS = 2000, 10.0, 0.002, 0.06, 2
"""An arm of 2000 joints: as many independent residuals."""
FIRST = 6 * (JOINTS + 1) + JOINTS
"""Index of the first torque among the concatenated residuals."""
K = 2.0 * math.pi * BANDWIDTH


def empty() -> tuple[Observers, ResidualEwma]:
    observers, ewma = (zeros(kind, joints=JOINTS, link_sensors=0) for kind in (Observers, ResidualEwma))
    assert isinstance(observers, Observers)
    assert isinstance(ewma, ResidualEwma)
    return observers, ewma


def test_its_stated_noise_is_that_of_simulated_residuals() -> None:
    """Low-passed white noise: an Ornstein-Uhlenbeck process. Of 2000 values a variance is known to 3 %."""
    observers, ewma = empty()
    rng, correlation = np.random.default_rng(0), math.exp(-K * DT)
    residual = math.sqrt(VARIANCE) * rng.standard_normal(JOINTS)
    for i in range(300):
        observers.joints.residual[:] = residual
        update_ewma(ewma, observers, VARIANCE, SENSORS, DT, BANDWIDTH)
        status, mean = ewma.status[0], ewma.mean[FIRST : FIRST + JOINTS]
        if i in (0, 5, 20, 80, 299):
            assert mean.var() == pytest.approx(status.variance_ratio, rel=0.1)
            by_chance = math.sqrt(2.0 * VARIANCE * status.variance_ratio / JOINTS)
            assert np.mean(mean * residual) == pytest.approx(status.residual_covariance, abs=4.0 * by_chance)
        step = math.sqrt(VARIANCE * (1.0 - correlation**2)) * rng.standard_normal(JOINTS)
        residual = correlation * residual + step
    # Two low-passes one after the other: the second leaves f2 / (f1 + f2) of the variance.
    expected = VARIANCE * RELATIVE_BANDWIDTH / (1.0 + RELATIVE_BANDWIDTH)
    assert status.variance_ratio == pytest.approx(expected, rel=0.1)


def test_it_is_the_mean_of_all_samples_at_first_and_then_forgets_exponentially() -> None:
    observers, ewma = empty()
    values = np.random.default_rng(1).standard_normal(200)
    for i, value in enumerate(values):
        observers.joints.residual[:] = value
        update_ewma(ewma, observers, VARIANCE, SENSORS, DT, BANDWIDTH)
        if i < 20:
            assert ewma.mean[FIRST] == pytest.approx(values[: i + 1].mean())
    observers.joints.residual[:] = before = ewma.mean[FIRST]
    for _ in range(50):
        update_ewma(ewma, observers, VARIANCE, SENSORS, DT, BANDWIDTH)
    assert ewma.mean[FIRST] == pytest.approx(before)
    observers.joints.residual[:] = before + 1.0
    for _ in range(40):
        update_ewma(ewma, observers, VARIANCE, SENSORS, DT, BANDWIDTH)
    assert ewma.mean[FIRST] - before == pytest.approx(1.0 - math.exp(-40.0 * RELATIVE_BANDWIDTH * K * DT))
    # The mean age of an exponential average is its time constant, that of the observers added.
    assert ewma.status[0].age == pytest.approx(1.0 / (RELATIVE_BANDWIDTH * K) + 1.0 / K, rel=0.1)


@pytest.mark.parametrize("cause", ["restart", "other sensors"])
def test_it_starts_again_with_the_newest_residual(cause: str) -> None:
    observers, ewma = empty()
    for value in (1.0, 2.0, 3.0):
        observers.joints.residual[:] = value
        update_ewma(ewma, observers, VARIANCE, SENSORS, DT, BANDWIDTH)
    if cause == "restart":
        restart_ewma(ewma)
    update_ewma(ewma, observers, 0.5, SENSORS + (cause != "restart"), DT, BANDWIDTH)
    assert ewma.mean[FIRST] == 3.0
    assert ewma.status[0].variance_ratio == ewma.status[0].residual_covariance == 0.5
    assert ewma.status[0].samples == 1.0


@pytest.mark.parametrize("in_ewma", [0.2, 0.5, 1.0, 1.5])
def test_the_share_of_a_model_error_is_between_a_residual_and_the_ewma(in_ewma: float) -> None:
    # A measurement without a stream has more noise than a residual, a long average less than the EWMA.
    assert share_in_average(in_ewma, 1e6) == share_in_average(in_ewma, 1.0) == 1.0
    assert share_in_average(in_ewma, NOISE_SHARE) == share_in_average(in_ewma, 0.0) == in_ewma
    between = [share_in_average(in_ewma, share) for share in np.linspace(NOISE_SHARE, 1.0, 20)]
    assert (np.diff(between) * (1.0 - in_ewma) >= 0.0).all()


def test_the_share_of_an_error_as_fast_as_noise_is_that_of_noise() -> None:
    for share in np.linspace(NOISE_SHARE, 1.0, 20):
        assert share_in_average(NOISE_SHARE, share) == pytest.approx(share)
