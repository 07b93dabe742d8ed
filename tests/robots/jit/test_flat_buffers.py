"""Declared arrays: their shapes, and the same memory in Python and in kernels."""

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsense.robots.jit.declaration import Floats, Integers, Records, Sized, fields_of, record
from contactsense.robots.jit.flat_buffers import FlatBuffers, views_kernel, zeros
from contactsense.robots.jit.kernel import kernel

AXES = 3


@record
class Clock:
    """Three types of numbers."""

    time: float
    ticks: int
    running: bool


class Observer(NamedTuple):
    """A declaration within others."""

    momentum: Annotated[Floats, "equations"]
    integrand: Annotated[Floats, f"{AXES}, equations"]
    clock: Annotated[Records[Clock], "1"]


class State(NamedTuple):
    """The outermost declaration."""

    gain: float
    joints: Annotated[Observer, Sized(equations="2 * joints")]
    links: Annotated[Integers, "max(joints, 4)"]
    sensors: Annotated[Observer, Sized("sensors", equations="6")]
    clocks: Annotated[Records[Clock], "joints + 1"]
    covariance: Annotated[Floats, "joints, 2, joints"]


views = views_kernel("views", (State,), ("joints", "sensors"), __name__)


@kernel
def _change(buffers: tuple[np.ndarray, np.ndarray]) -> float:
    """Change something of every field."""
    state = views(buffers)
    state.joints.momentum[0] += 1.0
    state.joints.integrand[2, 1] += 2.0
    state.joints.clock[0].time += state.gain
    state.links[3] += 3
    for s in range(state.sensors.momentum.shape[0]):
        state.sensors.momentum[s, 5] += 4.0
        state.sensors.integrand[s, 1, 2] += 5.0
        state.sensors.clock[s, 0].ticks += s + 1
    last = state.clocks[state.clocks.shape[0] - 1]
    last.running = not last.running
    state.covariance[0, 1, 0] += 6.0
    return float(state.joints.clock[0].time)


def _changed(state: Any) -> None:
    """The same in Python."""
    state.joints.momentum[0] += 1.0
    state.joints.integrand[2, 1] += 2.0
    state.joints.clock[0].time += state.gain
    state.links[3] += 3
    for s in range(len(state.sensors.momentum)):
        state.sensors.momentum[s, 5] += 4.0
        state.sensors.integrand[s, 1, 2] += 5.0
        state.sensors.clock[s, 0].ticks += s + 1
    state.clocks[-1].running = not state.clocks[-1].running
    state.covariance[0, 1, 0] += 6.0


def _arrays(value: Any) -> list[Any]:
    return [part for item in value for part in _arrays(item)] if isinstance(value, tuple) else [value]


def _filled(joints: int, sensors: int) -> State:
    state, chance = zeros(State, joints=joints, sensors=sensors)._replace(gain=0.5), np.random.default_rng(1)
    for array in _arrays(state)[1:]:
        array.view(np.uint8).reshape(-1)[:] = 0
        if array.dtype.names:
            array["time"], array["ticks"] = chance.random(array.shape), chance.integers(9, size=array.shape)
        else:
            array[...] = 100.0 * chance.random(array.shape)
    return state


@settings(max_examples=20)
@given(st.integers(1, 7), st.integers(0, 3))
def test_a_kernel_changes_what_python_sees_and_nothing_else(joints: int, sensors: int) -> None:
    expected = _filled(joints, sensors)
    buffers = FlatBuffers((expected,), {"joints": joints, "sensors": sensors})
    (state,) = buffers.views
    assert _change((buffers.floats, buffers.integers)) == state.joints.clock[0].time
    _changed(expected)
    for mine, theirs in zip(_arrays(expected), _arrays(state), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_arrays_have_the_declared_shapes_and_types() -> None:
    state = zeros(State, joints=2, sensors=3)
    assert state.joints.momentum.shape == (4,)
    assert state.joints.integrand.shape == (3, 4)
    assert state.links.shape == (4,)
    assert state.links.dtype == np.int64
    assert state.sensors.momentum.shape == (3, 6)
    assert np.shape(state.sensors.clock) == (3, 1)
    assert np.shape(state.clocks) == (3,)
    assert state.covariance.shape == (2, 2, 2)
    assert state.gain == 0.0


def test_a_missing_size_is_named() -> None:
    with pytest.raises(NameError, match="sensors"):
        zeros(State, joints=2)


def test_an_array_of_another_shape_is_refused() -> None:
    state = zeros(State, joints=2, sensors=1)._replace(links=np.zeros(3, dtype=np.int64))
    with pytest.raises(ValueError, match=r"State\.links: expected shape \(4,\), got \(3,\)"):
        FlatBuffers((state,), {"joints": 2, "sensors": 1})


class _Undeclared(NamedTuple):
    force: np.ndarray


def test_a_field_without_a_shape_is_refused() -> None:
    with pytest.raises(TypeError, match=r"_Undeclared\.force: expected float, a declaration"):
        fields_of(_Undeclared)


def test_a_record_holds_numbers_only() -> None:
    class Named:
        name: str

    with pytest.raises(TypeError, match=r"Named\.name: expected float, int or bool, got <class 'str'>"):
        record(Named)
