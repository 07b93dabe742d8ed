"""The forms in which sensors are usable name the same sensors."""

import itertools

import pytest

from contactsense.robots.jit.flat_buffers import zeros
from contactsense.sensors.stream_state import StreamState
from contactsense.sensors.usable_sensors import (
    sensor_bits_of,
    sensors_in,
    usable_residuals_code,
    usable_residuals_code_in_python,
    usable_sensors,
    usable_sensors_in_python,
)


@pytest.mark.parametrize("usable", list(itertools.product([False, True], [False, True], [0, 1, 2, 3])))
def test_bits_name_the_same_sensors(usable: tuple[bool, bool, int]) -> None:
    assert sensors_in(sensor_bits_of(usable)) == usable


def test_python_and_the_kernels_agree() -> None:
    """With two link sensors: three residuals, then two wrenches and two differences."""
    stream = zeros(StreamState, joints=6, link_sensors=2)
    codes = set()
    for flags in itertools.product([0, 1], repeat=7):
        stream.usable[:] = flags
        base, torque, _, first, second, _, _ = flags
        expected = (base == 1, torque == 1, first + 2 * second)
        assert usable_sensors(stream) == usable_sensors_in_python(stream) == expected
        assert usable_residuals_code(stream) == usable_residuals_code_in_python(stream)
        codes.add(usable_residuals_code(stream))
    assert len(codes) == 2**7
