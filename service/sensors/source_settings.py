"""Settings of the live samples: addresses of the sensors, and how they are read.

What a Python program gives is checked here; the service checks its options.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Literal

from contactsense.service.sensors.clients import netft_client as netft
from contactsense.service.sensors.clients import rtde_client as rtde
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.network_wrench import WrenchSource


@dataclass(frozen=True, slots=True)
class SourceSettings:
    """Addresses of the sensors, and how they are read. Raises `SensorError` where a field cannot be used."""

    robot_host: str
    robot_port: int = rtde.DEFAULT_PORT
    client: Literal["rtde", "ur_rtde"] = "rtde"
    """`rtde`: our own reader, which loses nothing; `ur_rtde`: runs in a separate process, always on port
    30004."""
    frequency: float = 500.0
    """Sample rate of the robot [Hz]: 500 for e-Series, 125 for CB3."""
    wrench_host: str | None = None
    """Address of the Net F/T sensor under the base; None: there is none."""
    wrench_port: int = netft.DEFAULT_PORT
    wrench_http_port: int = netft.DEFAULT_HTTP_PORT
    wrench_counts: tuple[float, float] | None = None
    """Counts per newton and newton metre; None: ask the sensor's web server."""
    wrench_fields: tuple[str, ...] = ()
    """RTDE fields that contain the base sensor's six values [N, Nm], such as six output registers, instead
    of `wrench_host`."""
    wrist_fields: tuple[str, ...] = ("ft_raw_wrench",)
    """RTDE fields that contain the wrist sensor's six values [N, Nm], if the scene has one."""
    link_wrenches: Mapping[str, WrenchSource] = field(default_factory=dict)
    """Sources of the scene's further sensors within the arm, by name."""
    extra_fields: tuple[str, ...] = ()
    """Further RTDE fields to read, for recordings."""
    wrench_rate: float | None = None
    """Rate of the sensor's sequence numbers [Hz]; None: estimated from arrival times, which takes longer on a
    busy host."""
    wrench_delay: float = 0.0
    """Constant difference of the network delays, force/torque reading minus robot packet [s]."""
    wrench_max_age: float = 0.005
    """A force/torque reading older than this, and older than 1.5 times the interval between two, is not used
    [s]; nor is one in RTDE fields that has been repeated for longer than this. In motion, readings that are
    10 ms old look like a contact."""
    constant_readings: bool = False
    """Whether readings may stay constant, like those of a simulator without noise; otherwise a signal that
    never changes counts as frozen."""
    wrench_wait: float = 0.003
    """Maximum time that a robot sample waits for the force/torque reading of its instant, beyond the delay of
    the readings [s]."""

    def __post_init__(self) -> None:
        _check(self)


def _check(settings: SourceSettings) -> None:
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
