"""Functions of URScript that the mock executes, with what their arguments must be."""

import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal, get_args

from contactsense.service.wire.rtde_fields import INPUTS

WatchdogAction = Literal["pause", "stop", "ignore"]
"""What the controller does with a program whose watchdog is not fed."""

_JOINTS = 6
REGISTERS = 48
"""Number of integer and of double registers in each direction."""
_BOOLEAN_REGISTERS = 128
_MOST_INTEGER = 2**31


def number(value: Any) -> float:
    """Return a finite number; raises ValueError for anything else, as do the functions below."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not _is_finite(value):
        raise _unexpected("a number", value)
    return float(value)


def positive(value: Any) -> float:
    """Return a number above 0."""
    if number(value) <= 0.0:
        raise _unexpected("a number above 0", value)
    return float(value)


def joint_positions(value: Any) -> list[float]:
    """Return the positions of the six joints."""
    if not isinstance(value, list) or len(value) != _JOINTS:
        raise _unexpected(f"a list of {_JOINTS} numbers", value)
    return [number(each) for each in value]


def _not_negative(value: Any) -> float:
    if number(value) < 0.0:
        raise _unexpected("a number of at least 0", value)
    return float(value)


def _integer(value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value < high:
        raise _unexpected(f"an integer from {low} to {high - 1}", value)
    return value


def _boolean(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _unexpected("True or False", value)
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _unexpected("text", value)
    # Python's escapes, which URScript does not have, can make strings that are not Unicode.
    return value.encode("utf-8", "replace").decode()


def _anything(value: Any) -> Any:
    return _text(value) if isinstance(value, str) else value


def input_field(value: Any) -> str:
    """Return the name of an RTDE input: nobody can write another one, so that its watchdog would always
    act."""
    if not isinstance(value, str) or value not in INPUTS:
        raise _unexpected("an RTDE input such as 'input_int_register_47'", value)
    return str(value)


def _watchdog_action(value: Any) -> str:
    if value not in get_args(WatchdogAction):
        raise _unexpected(f"one of {', '.join(get_args(WatchdogAction))}", value)
    return str(value)


def _is_finite(value: float) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # an integer that no floating-point number can hold
        return False


def _unexpected(wanted: str, value: Any) -> ValueError:
    return ValueError(f"expected {wanted}, got {reprlib.repr(value)}")


@dataclass(frozen=True, slots=True)
class _Parameter:
    name: str
    read: Callable[[Any], Any]
    """Returns the argument, or raises ValueError."""
    required: bool = True


def _optional(name: str, read: Callable[[Any], Any]) -> _Parameter:
    return _Parameter(name, read, required=False)


def _write(read: Callable[[Any], Any], registers: int) -> tuple[_Parameter, ...]:
    address = _Parameter("address", lambda value: _integer(value, 0, registers))
    return address, _Parameter("value", read)


_FUNCTIONS: Mapping[str, tuple[_Parameter, ...]] = {
    "stopj": (_optional("a", positive),),
    "stopl": (_optional("a", positive), _optional("aRot", positive)),
    "movej": (
        _Parameter("q", joint_positions),
        _optional("a", positive),
        _optional("v", positive),
        _optional("t", _not_negative),
        _optional("r", _not_negative),
    ),
    "sleep": (_Parameter("t", _not_negative),),
    "sync": (),
    "textmsg": (_Parameter("s1", _anything), _optional("s2", _anything)),
    "popup": (
        _Parameter("s", _anything),
        _optional("title", _text),
        _optional("warning", _boolean),
        _optional("error", _boolean),
        _optional("blocking", _boolean),
    ),
    "protective_stop": (),
    "halt": (),
    "rtde_set_watchdog": (
        _Parameter("variable_name", input_field),
        _Parameter("min_frequency", positive),
        _optional("action", _watchdog_action),
    ),
    "write_output_integer_register": _write(
        lambda value: _integer(value, -_MOST_INTEGER, _MOST_INTEGER), REGISTERS
    ),
    "write_output_float_register": _write(number, REGISTERS),
    "write_output_boolean_register": _write(_boolean, _BOOLEAN_REGISTERS),
}
FUNCTIONS = frozenset(_FUNCTIONS)
"""Names of the functions."""


def check_arguments(function: str, given: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a call, by parameter.

    Args:
        function: One of `FUNCTIONS`.
        given: Arguments without a name, in order.
        named: Arguments with a name.

    Raises:
        ValueError: One is missing or wrong, or there are too many.
    """
    parameters = _FUNCTIONS[function]
    if len(given) > len(parameters):
        raise ValueError(f"{function}: expected at most {len(parameters)} arguments, got {len(given)}")
    names = [parameter.name for parameter in parameters]
    by_name = dict(zip(names, given, strict=False))
    for name in named:
        if name not in names:
            raise ValueError(
                f"{function}: expected arguments out of {', '.join(names) or 'none'}, got {name}"
            )
        if name in by_name:
            raise ValueError(f"{function}: {name}: expected one value, got two")
    by_name |= named
    arguments = {}
    for parameter in parameters:
        if parameter.name in by_name:
            arguments[parameter.name] = _read(function, parameter, by_name[parameter.name])
        elif parameter.required:
            raise ValueError(f"{function}: expected {parameter.name}, got nothing")
    return arguments


def _read(function: str, parameter: _Parameter, value: Any) -> Any:
    try:
        return parameter.read(value)
    except ValueError as error:
        raise ValueError(f"{function}: {parameter.name}: {error}") from None
