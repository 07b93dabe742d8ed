"""Views whose users are not counted, for compiled functions that hand them about."""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import populate_array


def uncounted(array: np.ndarray) -> np.ndarray:
    """The same array, of which compiled code keeps no count of users, nor of the views made of it.

    Numba counts, atomically, every time an array is handed from one function to another. Whoever calls the
    compiled function from Python keeps the array alive meanwhile, so that nothing needs to be counted; the
    views must not outlive that call.
    """
    return array


def block(buffer: np.ndarray, at: int, shape: tuple[int, ...]) -> np.ndarray:
    """`buffer[at : at + product(shape)].reshape(shape)`, uncounted, without a look at the bounds: a tenth of
    the time."""
    return buffer[at : at + int(np.prod(shape))].reshape(shape)


@overload(uncounted)
def _uncounted(array):  # type: ignore[no-untyped-def]
    return lambda array: _without_owner(array)  # type: ignore[call-arg]


@overload(block)
def _block(buffer, at, shape):  # type: ignore[no-untyped-def]
    return lambda buffer, at, shape: _view(buffer, at, shape)  # type: ignore[call-arg]


@intrinsic
def _without_owner(context: Any, array: Any) -> Any:
    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = cgutils.create_struct_proxy(array)(target, builder, value=arguments[0])  # type: ignore[no-untyped-call]
        view.meminfo = cgutils.get_null_value(view.meminfo.type)  # type: ignore[no-untyped-call]
        view.parent = cgutils.get_null_value(view.parent.type)  # type: ignore[no-untyped-call]
        return view._getvalue()

    return array(array), generate


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
