"""Arm and memory in two flat arrays, because handing eighty arrays to a compiled function takes longer than
its work."""

from typing import Any

import numpy as np

from contactsense.arm import Arm
from contactsense.memory import Memory


class Workspace:
    """The buffers, and the named views of them.

    The arrays of `Arm` and `Memory` lie one behind the other in the order in which the fields are declared,
    floats in one buffer and integers in another; `contactsense.unfold` makes the same views inside a kernel.
    """

    def __init__(self, arm: Arm, memory: Memory) -> None:
        """Copy everything into the buffers."""
        floats: list[np.ndarray] = []
        integers: list[np.ndarray] = []
        _collect((arm, memory), floats, integers)
        self.floats = np.concatenate([array.ravel() for array in floats])
        self.integers = np.concatenate([array.ravel() for array in integers])
        surface = (len(arm.surfaces.kind), len(arm.places.spread), len(arm.parts.spread))
        self.sizes = (arm.model.joints, len(arm.touchable), *surface)
        """Numbers of joints, links, primitives, places and parts of their cells."""
        self._float, self._integer = 0, 0
        self.arm: Arm = self._view(arm)
        self.memory: Memory = self._view(memory)

    def _view(self, value: Any) -> Any:
        """The same structure with views of the buffers for arrays, in the order of `_collect`."""
        if isinstance(value, tuple):
            return type(value)(*map(self._view, value))
        if isinstance(value, float):
            self._float += 1
            return value
        if value.dtype == np.float64:
            first, self._float = self._float, self._float + value.size
            return self.floats[first : self._float].reshape(value.shape)
        first, self._integer = self._integer, self._integer + value.size
        return self.integers[first : self._integer].reshape(value.shape)


def _collect(value: Any, floats: list[np.ndarray], integers: list[np.ndarray]) -> None:
    if isinstance(value, tuple):
        for part in value:
            _collect(part, floats, integers)
    elif isinstance(value, float):
        floats.append(np.array([value]))
    else:
        (floats if value.dtype == np.float64 else integers).append(value)
