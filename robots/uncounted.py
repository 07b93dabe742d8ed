"""Arrays whose users are not counted, for compiled functions that hand views about."""

from typing import Any

import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic, overload


def uncounted(array: np.ndarray) -> np.ndarray:
    """The same array, of which compiled code keeps no count of users, nor of the views made of it.

    Numba counts, atomically, every time an array is handed from one function to another. Whoever calls the
    compiled function from Python keeps the array alive meanwhile, so that nothing needs to be counted; the
    views must not outlive that call.
    """
    return array


@overload(uncounted)
def _uncounted(array):  # type: ignore[no-untyped-def]
    return lambda array: _without_owner(array)  # type: ignore[call-arg]


@intrinsic
def _without_owner(context: Any, array: Any) -> Any:
    def generate(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = cgutils.create_struct_proxy(array)(target, builder, value=arguments[0])  # type: ignore[no-untyped-call]
        view.meminfo = cgutils.get_null_value(view.meminfo.type)  # type: ignore[no-untyped-call]
        view.parent = cgutils.get_null_value(view.parent.type)  # type: ignore[no-untyped-call]
        return view._getvalue()

    return array(array), generate
