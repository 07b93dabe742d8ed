"""The kernels' view of the buffers is Python's view of them, array by array."""

from typing import Any

import numpy as np
import pytest

from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.robots.jit.declaration import WORD
from contactsense.robots.jit.kernel import allocating_kernel
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.runtime.buffers import Buffers, KernelBuffers, buffer_views
from contactsense.runtime.constants import Constants, build_constants
from contactsense.runtime.state import State, empty_state
from tests.plain_arm import plain_ur5e


@allocating_kernel
def _unfold(buffers: Buffers) -> tuple[Constants, State]:
    """Other kernels cannot hand arrays to Python."""
    views: tuple[Constants, State] = buffer_views(buffers)
    return views


def _arrays(value: Any) -> list[Any]:
    return [part for item in value for part in _arrays(item)] if isinstance(value, tuple) else [value]


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
    kernel = _arrays(_unfold(work.arguments))
    assert len(original) == len(python) == len(kernel)
    for before, mine, theirs in zip(original, python, kernel, strict=True):
        if isinstance(before, float):
            assert before == mine == theirs
            continue
        assert before.shape == mine.shape == theirs.shape
        np.testing.assert_array_equal(before, mine)
        assert mine.size == 0 or mine.ctypes.data == theirs.ctypes.data
        assert mine.dtype == theirs.dtype
    covered = sum(1 if isinstance(part, float) else part.nbytes // WORD for part in python)
    assert covered == work.floats.size + work.integers.size
