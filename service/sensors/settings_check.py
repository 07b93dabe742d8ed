"""Checks of the settings that a Python program gives for the sensors; the service checks its options."""

import math
from numbers import Real
from typing import TYPE_CHECKING, Any

from contactsense.service.sensors.robot_stream import SensorError

if TYPE_CHECKING:
    from contactsense.service.sensors.live_source import SourceSettings


def check_settings(settings: "SourceSettings") -> None:
    """Check the numbers of the settings, and those of their `link_wrenches`.

    Raises:
        SensorError: A field cannot be used; the text names it.
    """
    if settings.client not in ("rtde", "ur_rtde"):
        raise SensorError(f"client: expected rtde or ur_rtde, got {settings.client!r}")
    for name in ("robot_port", "wrench_port", "wrench_http_port"):
        _check_port(name, getattr(settings, name))
    for name in ("frequency", "wrench_rate", "wrench_max_age"):
        value = getattr(settings, name)
        if not _is_positive(value) and not (name == "wrench_rate" and value is None):
            raise SensorError(f"{name}: expected a number above 0, got {value!r}")
    if not _is_finite(settings.wrench_wait) or settings.wrench_wait < 0.0:
        raise SensorError(f"wrench_wait: expected a number of at least 0, got {settings.wrench_wait!r}")
    if not _is_finite(settings.wrench_delay):
        raise SensorError(f"wrench_delay: expected a finite number, got {settings.wrench_delay!r}")
    _check_counts("wrench_counts", settings.wrench_counts)
    for name, source in settings.link_wrenches.items():
        _check_port(f"link_wrenches.{name}.port", source.port)
        _check_port(f"link_wrenches.{name}.http_port", source.http_port)
        _check_counts(f"link_wrenches.{name}.counts", source.counts)


def _check_port(name: str, port: Any) -> None:
    if not isinstance(port, int) or isinstance(port, bool) or not 0 <= port <= 65535:
        raise SensorError(f"{name}: expected a whole number from 0 to 65535, got {port!r}")


def _check_counts(name: str, counts: Any) -> None:
    if counts is None:
        return
    if not (isinstance(counts, list | tuple) and len(counts) == 2 and all(map(_is_positive, counts))):
        raise SensorError(f"{name}: expected two numbers above 0, counts per N and per Nm, got {counts!r}")


def _is_finite(value: Any) -> bool:
    # A flag is a number to Python.
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _is_positive(value: Any) -> bool:
    return _is_finite(value) and value > 0.0
