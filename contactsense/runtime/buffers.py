"""Constants and state of a scene in two flat buffers, see `contactsense.robots.jit.flat_buffers`."""

from typing import TypeAlias

import numpy as np

from contactsense.robots.jit.flat_buffers import FlatBuffers, views_kernel
from contactsense.runtime.constants import Constants, sizes_of
from contactsense.runtime.state import State

SIZES = ("joints", "links", "primitives", "samples", "blocks", "subsamples", "link_sensors", "deviations")
"""Order of the sizes in `KernelBuffers.arguments`."""

buffer_views = views_kernel("buffer_views", (Constants, State), SIZES, __name__)
"""Kernel that finds `Constants` and `State` in `KernelBuffers.arguments`."""

Buffers: TypeAlias = tuple[np.ndarray, np.ndarray, tuple[int, ...]]
"""Buffer of floats, buffer of integers, sizes."""


class KernelBuffers(FlatBuffers):
    """The flat buffers and the named views of them."""

    def __init__(self, constants: Constants, state: State) -> None:
        """Copy everything into the buffers."""
        sizes = sizes_of(constants)
        super().__init__((constants, state), sizes)
        self.arguments: Buffers = (self.floats, self.integers, tuple(sizes[name] for name in SIZES))
        """What kernels take. A plain tuple: Numba takes longer to recognize a named one."""
        self.constants: Constants
        self.state: State
        self.constants, self.state = self.views
