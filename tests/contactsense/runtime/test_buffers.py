"""The kernels' view of the buffers is Python's view of them, array by array."""

from typing import Any

import numpy as np
import pytest
from numba import typeof
from numba.np.numpy_support import from_dtype

from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.robots.jit.declaration import WORD
from contactsense.robots.jit.kernel import generated_kernel, kernel
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.runtime.buffers import SIZES, KernelBuffers, buffer_views
from contactsense.runtime.state import State, empty_state
from contactsense.scene_model.constants import Constants, build_constants
from tests.plain_arm import plain_ur5e

MOST_AXES = 3


def _arrays(value: Any) -> list[Any]:
    """All arrays and numbers of nested named tuples; of the types of these, all types."""
    inner = value if isinstance(value, tuple) else getattr(value, "types", None)
    return [value] if inner is None else [part for item in inner for part in _arrays(item)]


def _names(value: Any, name: str) -> list[str]:
    """How a kernel calls each of them."""
    if not isinstance(value, tuple):
        return [name]
    return [x for field in value._fields for x in _names(getattr(value, field), f"{name}.{field}")]


@kernel
def _put(array: np.ndarray, place: np.ndarray) -> None:
    place[0] = array.ctypes.data
    for axis in range(array.ndim):
        place[1 + axis] = array.shape[axis]


def _places(constants: Constants, state: State) -> Any:
    """A kernel that writes address and shape of each array, and each number: to hand the arrays themselves to
    Python would take longer to compile than all that is in them."""
    lines = ["def places(buffers, where, numbers):", "    constants, state = buffer_views(buffers)"]
    names = _names(constants, "constants") + _names(state, "state")
    for i, (name, value) in enumerate(zip(names, _arrays((constants, state)), strict=True)):
        if isinstance(value, float):
            lines.append(f"    numbers[{i}] = {name}")
            continue
        lines.append(f"    put({name}, where[{i}])")
    names_used = {"buffer_views": buffer_views, "put": _put}
    return generated_kernel("places", "\n".join(lines), names_used, __name__)


@pytest.mark.slow
@pytest.mark.parametrize("links", [(), ("upper_arm", "forearm")])
def test_every_array_is_the_same_memory_on_both_sides(links: tuple[str, ...]) -> None:
    tool = Tool(mass=1.0, primitives=(Sphere(center=(0, 0, 0.1), radius=0.02),))
    sensors = tuple(LinkWrenchSensor(name=link, link=link) for link in links)
    wrist = WrenchSensor() if links else None
    constants = build_constants(
        Scene(robot=plain_ur5e(), tool=tool, link_wrenches=sensors, wrist_wrench=wrist)
    )
    state = empty_state(constants)
    work = KernelBuffers(constants, state)
    original = _arrays((constants, state))
    python = _arrays((work.constants, work.state))
    where, numbers = np.zeros((len(original), 1 + MOST_AXES), dtype=np.int64), np.zeros(len(original))
    _places(constants, state)(work.arguments, where, numbers)
    # Where `places` comes from the cache, the kernel that it calls has not been loaded.
    given = (typeof(work.arguments),)
    buffer_views.called_by_kernels.compile(given)
    types = _arrays(buffer_views.called_by_kernels.overloads[given].signature.return_type)
    assert len(original) == len(python) == len(types)
    for before, mine, kind, place, number in zip(original, python, types, where, numbers, strict=True):
        if isinstance(before, float):
            assert before == mine == number
            continue
        assert before.shape == mine.shape == tuple(place[1 : 1 + kind.ndim])
        np.testing.assert_array_equal(before, mine)
        assert mine.size == 0 or mine.ctypes.data == place[0]
        assert from_dtype(mine.dtype) == kind.dtype
    covered = sum(1 if isinstance(part, float) else part.nbytes // WORD for part in python)
    # The integers begin with the sizes and the place of each.
    assert covered + len(SIZES) + len(python) == work.floats.size + work.integers.size
