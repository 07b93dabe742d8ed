"""Constants and state of a scene in two flat buffers, see `contactsense.robots.jit.flat_buffers`."""

from typing import TypeAlias

import numpy as np

from contactsense.robots.jit.flat_buffers import FlatBuffers, views_kernel
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants, sizes_of

SIZES = ("joints", "links", "primitives", "samples", "blocks", "subsamples", "link_sensors", "deviations")
"""Order of the sizes in the buffers."""

buffer_views = views_kernel("buffer_views", (Constants, State), SIZES, __name__)
"""Kernel that finds `Constants` and `State` in `KernelBuffers.arguments`."""

Buffers: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Buffer of floats, buffer of integers."""


class KernelBuffers(FlatBuffers):
    """The flat buffers and the named views of them."""

    def __init__(self, constants: Constants, state: State) -> None:
        """Copy everything into the buffers."""
        sizes = sizes_of(constants)
        super().__init__((constants, state), {name: sizes[name] for name in SIZES})
        self.arguments: Buffers = (self.floats, self.integers)
        """What kernels take. A plain tuple: Numba takes longer to recognize a named one."""
        self.constants: Constants
        self.state: State
        self.constants, self.state = self.views
