"""A kernel that is called directly is the same kernel."""

import numpy as np
import pytest

from contactsense.robots.jit.direct_call import direct_call
from contactsense.robots.jit.kernel import kernel


@kernel
def _scaled_sum(pair: tuple[np.ndarray, int], factor: float) -> float:
    total = 0.0
    for value in pair[0]:
        total += factor * value
    return total + pair[1]


def test_calls_the_machine_code_for_the_types_of_the_example() -> None:
    any_layout = np.zeros(6)[::2]
    any_layout.setflags(write=False)
    call = direct_call(_scaled_sum, (any_layout, 1), 1.0)
    assert call((np.arange(4.0), 2), 3.0) == 20.0
    assert call((np.arange(8.0)[::4], 0), 1) == 4.0
    with pytest.raises(TypeError):
        call((np.arange(4.0), 2))
    with pytest.raises(TypeError):
        call((np.arange(4.0, dtype=np.float32), 2), 1.0)
    with pytest.raises(TypeError):
        call(([1.0], 2), 1.0)


def test_finds_what_is_compiled() -> None:
    one = direct_call(_scaled_sum, (np.zeros(1), 1), 1.0)
    assert direct_call(_scaled_sum, (np.zeros(3), 5), 2.0) is one


def test_a_plain_function_stays_itself() -> None:
    assert direct_call(max, 1, 2) is max
