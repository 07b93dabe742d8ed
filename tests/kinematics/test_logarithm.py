"""The logarithm without a call, against the library's."""

import numpy as np

from contactsense.kinematics.logarithm import logarithm
from contactsense.robots.jit.kernel import kernel


@kernel
def _all(values: np.ndarray) -> None:
    for i in range(values.shape[0]):
        values[i] = logarithm(values[i])


def test_it_is_as_accurate_as_stated() -> None:
    rng = np.random.default_rng(1)
    # All magnitudes, the neighbourhood of 1, and that of the places where the exponent changes.
    values = np.concatenate(
        (
            np.exp(rng.uniform(-708.0, 709.0, 10_000)),
            1.0 + rng.normal(size=10_000) * 10.0 ** rng.uniform(-16.0, -1.0, 10_000),
            np.sqrt(2.0) ** rng.integers(-200, 200, 10_000) * (1.0 + rng.normal(size=10_000) * 1e-15),
        )
    )
    expected = np.log(values)
    _all(values)
    np.testing.assert_allclose(values, expected, rtol=1e-13)


def test_it_is_exact_at_powers_of_two() -> None:
    values = 2.0 ** np.arange(-1022.0, 1024.0)
    expected = np.log(values)
    _all(values)
    np.testing.assert_allclose(values, expected, rtol=1e-15)


def test_other_values_give_finite_numbers() -> None:
    values = np.array([0.0, -1.0, np.inf, -np.inf, np.nan, 5e-324])
    _all(values)
    assert np.isfinite(values).all()
