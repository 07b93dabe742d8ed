"""Views and copies of arrays inside kernels, which cannot allocate."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import populate_array

from contactsense.robots.jit.kernel import kernel


@kernel
def copy(values: np.ndarray, out: np.ndarray) -> None:
    """Fill the vector `out` with the first of `values`; NumPy's `out[:] = values` would allocate in case the
    two overlap."""
    for i in range(out.shape[0]):
        out[i] = values[i]


def view(buffer: np.ndarray, at: int, shape: tuple[int, ...]) -> np.ndarray:
    """`buffer[at : at + product(shape)].reshape(shape)` without bounds checks, in a tenth of the time.

    The view does not keep the buffer alive.
    """
    return buffer[at : at + int(np.prod(shape))].reshape(shape)


def records(buffer: np.ndarray, at: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray:
    """The same for records, see `contactsense.robots.jit.declaration.record`, in a buffer of numbers."""
    words = dtype.itemsize // buffer.itemsize * int(np.prod(shape))
    return buffer[at : at + words].view(dtype).reshape(shape)


# Numba assumes that a function which returns an array allocates. If `strict`, it demands the same annotations
# of `_view`, which takes types, as of the function that it returns, which takes values.
@overload(view, jit_options={"_nrt": True}, strict=False)  # type: ignore[typeddict-unknown-key]
def _view(buffer: types.Type, at: types.Type, shape: types.Type) -> Callable[..., np.ndarray]:
    return lambda buffer, at, shape: _array_view(buffer, at, shape)  # type: ignore[call-arg]


@overload(records, jit_options={"_nrt": True}, strict=False)  # type: ignore[typeddict-unknown-key]
def _records(
    buffer: types.Type, at: types.Type, shape: types.Type, dtype: types.Type
) -> Callable[..., np.ndarray]:
    return lambda buffer, at, shape, dtype: _record_view(buffer, at, shape, dtype)  # type: ignore[call-arg]


@intrinsic
def _array_view(context: Any, buffer: Any, at: Any, shape: Any) -> Any:
    kind = types.Array(buffer.dtype, len(shape), "C")
    return kind(buffer, at, shape), _generator(kind)


@intrinsic
def _record_view(context: Any, buffer: Any, at: Any, shape: Any, dtype: Any) -> Any:
    kind = types.Array(dtype.dtype, len(shape), "C")
    return kind(buffer, at, shape, dtype), _generator(kind)


def _generator(kind: Any) -> Any:
    """Code that makes an array of that type."""

    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        buffer = cgutils.create_struct_proxy(signature.args[0])(target, builder, value=arguments[0])  # type: ignore[no-untyped-call]
        item = target.get_data_type(kind.dtype)
        data = builder.bitcast(builder.gep(buffer.data, [arguments[1]]), item.as_pointer())
        lengths = cgutils.unpack_tuple(builder, arguments[2], kind.ndim)  # type: ignore[no-untyped-call]
        size = target.get_constant(types.intp, target.get_abi_sizeof(item))
        strides = [size]
        for length in reversed(lengths[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        made = cgutils.create_struct_proxy(kind)(target, builder)  # type: ignore[no-untyped-call]
        populate_array(made, data, lengths, strides, size, None)  # type: ignore[no-untyped-call]
        return made._getvalue()

    return generate
