"""Constants and state of a scene in two flat buffers, see `contactsense.robots.jit.flat_buffers`."""

from contactsense.robots.jit.flat_buffers import FlatBuffers, views_kernel
from contactsense.runtime.constants import Constants, sizes_of
from contactsense.runtime.state import State

SIZES = ("joints", "links", "primitives", "samples", "subsamples", "link_sensors")
"""Order of `KernelBuffers.sizes`."""

buffer_views = views_kernel("buffer_views", (Constants, State), SIZES, __name__)
"""Kernel that finds `Constants` and `State` in `KernelBuffers.floats` and `KernelBuffers.integers`; its third
argument is `KernelBuffers.sizes`."""


class KernelBuffers(FlatBuffers):
    """The flat buffers and the named views of them."""

    def __init__(self, constants: Constants, state: State) -> None:
        """Copy everything into the buffers."""
        sizes = sizes_of(constants)
        super().__init__((constants, state), sizes)
        self.sizes = tuple(sizes[name] for name in SIZES)
        self.constants: Constants
        self.state: State
        self.constants, self.state = self.views
