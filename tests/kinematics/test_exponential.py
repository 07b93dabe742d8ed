"""The exponential function without a call, against the library's."""

import numpy as np
import pytest

from contactsense.kinematics.exponential import exponential
from contactsense.robots.jit.kernel import kernel


@kernel
def _all(values: np.ndarray) -> None:
    for i in range(values.shape[0]):
        values[i] = exponential(values[i])


@pytest.mark.parametrize(("lowest", "highest", "accuracy"), [(-12.0, 2.0, 1e-8), (-40.0, -12.0, 1e-4)])
def test_it_is_as_accurate_as_stated(lowest: float, highest: float, accuracy: float) -> None:
    values = np.linspace(lowest, highest, 10_001)
    expected = np.exp(values)
    _all(values)
    np.testing.assert_allclose(values, expected, rtol=accuracy)
