"""Views and copies of arrays inside kernels, which cannot allocate."""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import populate_array

from contactsense.robots.jit.kernel import kernel


@kernel
def copy(values, out):  # type: ignore[no-untyped-def]
    """Fill the vector `out` with the first of `values`; NumPy's `out[:] = values` would allocate in case the
    two overlap."""
    for i in range(out.shape[0]):
        out[i] = values[i]


def block(buffer: np.ndarray, at: int, shape: tuple[int, ...]) -> np.ndarray:
    """`buffer[at : at + product(shape)].reshape(shape)` without bounds checks, in a tenth of the time.

    The view does not keep the buffer alive.
    """
    return buffer[at : at + int(np.prod(shape))].reshape(shape)


# Numba assumes that a function which returns an array allocates.
@overload(block, jit_options={"_nrt": True})  # type: ignore[typeddict-unknown-key]
def _block(buffer, at, shape):  # type: ignore[no-untyped-def]
    return lambda buffer, at, shape: _view(buffer, at, shape)  # type: ignore[call-arg]


@intrinsic
def _view(context: Any, buffer: Any, at: Any, shape: Any) -> Any:
    kind = types.Array(buffer.dtype, len(shape), "C")

    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = cgutils.create_struct_proxy(buffer)(target, builder, value=arguments[0])  # type: ignore[no-untyped-call]
        view = cgutils.create_struct_proxy(kind)(target, builder)  # type: ignore[no-untyped-call]
        lengths = cgutils.unpack_tuple(builder, arguments[2], len(shape))  # type: ignore[no-untyped-call]
        strides = [whole.itemsize]
        for length in reversed(lengths[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        populate_array(  # type: ignore[no-untyped-call]
            view, builder.gep(whole.data, [arguments[1]]), lengths, strides, whole.itemsize, None
        )
        return view._getvalue()

    return kind(buffer, at, shape), generate
