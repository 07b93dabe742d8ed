"""Checks of the settings that a Python program gives for the sensors; the service checks its options."""

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

from contactsense.service.sensors.robot_stream import SensorError

_CLIENTS = ("rtde", "ur_rtde")
_PORTS = ("robot_port", "wrench_port", "wrench_http_port")
_ABOVE_ZERO = ("frequency", "wrench_rate", "wrench_max_age")
_NOT_BELOW_ZERO = ("wrench_wait",)
_ANY_NUMBER = ("wrench_delay",)


def check_settings(settings: Any) -> None:
    """Check the fields of `SourceSettings`, and the counts of its `link_wrenches`.

    Raises:
        SensorError: A field cannot be used; the text names it.
    """
    if settings.client not in _CLIENTS:
        raise SensorError(f"client: expected one of {', '.join(_CLIENTS)}, got {settings.client!r}")
    for name in _PORTS:
        port = getattr(settings, name)
        if not isinstance(port, int) or not 0 <= port <= 65535:
            raise SensorError(f"{name}: expected a whole number from 0 to 65535, got {port!r}")
    for names, least, expected in (
        (_ABOVE_ZERO, math.nextafter(0.0, 1.0), "a number above 0"),
        (_NOT_BELOW_ZERO, 0.0, "a number of at least 0"),
        (_ANY_NUMBER, -math.inf, "a finite number"),
    ):
        for name in names:
            value = getattr(settings, name)
            if not (_is_number(value) and value >= least) and not (name == "wrench_rate" and value is None):
                raise SensorError(f"{name}: expected {expected}, got {value!r}")
    counts: Mapping[str, Any] = {
        "wrench_counts": settings.wrench_counts,
        **{f"link_wrenches.{name}.counts": source.counts for name, source in settings.link_wrenches.items()},
    }
    for name, pair in counts.items():
        usable = (
            isinstance(pair, list | tuple) and len(pair) == 2 and all(_is_number(n) and n > 0.0 for n in pair)
        )
        if pair is not None and not usable:
            raise SensorError(f"{name}: expected two numbers above 0, counts per N and per Nm, got {pair!r}")


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and math.isfinite(value)
