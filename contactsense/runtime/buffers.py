"""Constants and state in two flat arrays: passing eighty arrays to a compiled function takes longer than its
computation."""

from typing import Any

import numpy as np

from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State


class KernelBuffers:
    """The flat buffers and the named views of them.

    The arrays of `Constants` and `State` are stored one after the other in the order in which the fields are
    declared, floats in one buffer and integers in the other. `contactsense.runtime.buffer_views` creates the
    same views inside a kernel.
    """

    def __init__(self, constants: Constants, state: State) -> None:
        """Copy everything into the buffers."""
        floats: list[np.ndarray] = []
        integers: list[np.ndarray] = []
        _collect((constants, state), floats, integers)
        self.floats = np.concatenate([array.ravel() for array in floats])
        self.integers = np.concatenate([array.ravel() for array in integers])
        surface = (
            len(constants.surfaces.kind),
            len(constants.samples.spread),
            len(constants.subsamples.spread),
        )
        self.sizes = (
            constants.model.joints, len(constants.touchable), *surface, len(constants.link_sensors.body),
        )  # fmt: skip
        """Numbers of joints, links, primitives, surface samples, subsamples and link sensors."""
        self._float, self._integer = 0, 0
        self.constants: Constants = self._view(constants)
        self.state: State = self._view(state)

    def _view(self, value: Any) -> Any:
        """The same structure, its arrays replaced by views of the buffers, in the order of `_collect`."""
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
