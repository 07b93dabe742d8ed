"""A call by the C library xmlrpc-c, which is what UR's controller uses: `xmlrpc_c.py URL METHOD [INTEGER]`.

Prints the numbers of the answer, one a line; the exit status is 1 where the library tells a fault.
"""

import ctypes
import sys

LIBRARIES = ("libxmlrpc_util.so.3", "libxmlrpc.so.3", "libxmlrpc_client.so.3")
_NO_FLAGS = 0


class _Environment(ctypes.Structure):
    _fields_ = (
        ("fault_occurred", ctypes.c_int),
        ("fault_code", ctypes.c_int),
        ("fault_string", ctypes.c_char_p),
    )


def main(url: str, method: str, *arguments: str) -> int:
    util, core, client = (ctypes.CDLL(name, ctypes.RTLD_GLOBAL) for name in LIBRARIES)
    env = _Environment()
    at = ctypes.byref(env)
    util.xmlrpc_env_init(at)
    client.xmlrpc_client_init2(at, _NO_FLAGS, b"test", b"1", None, 0)
    client.xmlrpc_client_call.restype = ctypes.c_void_p
    core.xmlrpc_array_size.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
    core.xmlrpc_array_read_item.argtypes = (
        ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.POINTER(ctypes.c_void_p),
    )  # fmt: skip
    core.xmlrpc_read_double.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.POINTER(ctypes.c_double))
    form = b"(" + b"i" * len(arguments) + b")"
    values = [ctypes.c_int(int(argument)) for argument in arguments]
    answer = client.xmlrpc_client_call(at, url.encode(), method.encode(), form, *values)
    if not env.fault_occurred:
        for index in range(core.xmlrpc_array_size(at, answer)):
            item, number = ctypes.c_void_p(), ctypes.c_double()
            core.xmlrpc_array_read_item(at, answer, index, ctypes.byref(item))
            core.xmlrpc_read_double(at, item, ctypes.byref(number))
            if env.fault_occurred:
                break
            print(number.value)
    if env.fault_occurred:
        print(env.fault_string.decode(), file=sys.stderr)
    return int(bool(env.fault_occurred))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
