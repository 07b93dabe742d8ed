"""Which sensors a sample has, or can be used in it.

There are four forms. Functions take `Usable`. Kernels that Python calls take `sensor_bits`, one number.
`StreamState.usable` has a flag for each residual of a stream, differences between two sensors included. The
code of the usable residuals is the same in one number, which tells whether they have changed.
"""

from typing import TypeAlias

from contactsense.robots.jit.kernel import kernel
from contactsense.sensors.stream_state import BASE, LINK, TORQUE, StreamState

Usable: TypeAlias = tuple[bool, bool, int]
"""Whether base wrench and joint torques are used, and which link sensors, one bit each. A plain tuple: Numba
takes longer to recognize a named one."""


def sensor_bits_of(usable: Usable) -> int:
    """The same as one number: 1 for the base wrench, 2 for the torques, 4, 8, ... for the link sensors."""
    base, torque, link_sensors = usable
    return base + 2 * torque + 4 * link_sensors


@kernel
def sensors_in(sensor_bits: int) -> Usable:
    """The inverse of `sensor_bits_of`."""
    return sensor_bits & 1 != 0, sensor_bits & 2 != 0, sensor_bits >> 2


@kernel
def usable_sensors(stream: StreamState) -> Usable:
    """The sensors whose residuals can be used in the newest sample."""
    link_sensors = 0
    for s in range(stream.link_wrench.shape[0]):
        if stream.usable[LINK + s] > 0:
            link_sensors |= 1 << s
    return stream.usable[BASE] > 0, stream.usable[TORQUE] > 0, link_sensors


@kernel
def usable_residuals_code(stream: StreamState) -> int:
    """A number that identifies the set of usable residuals."""
    code = 0
    for i in range(stream.usable.shape[0]):
        code = 2 * code + stream.usable[i]
    return code


def usable_sensors_in_python(stream: StreamState) -> Usable:
    """`usable_sensors` without the time that Python takes to call a kernel."""
    usable = stream.usable.tolist()
    link_sensors = 0
    for s in range(len(stream.link_wrench)):
        if usable[LINK + s] > 0:
            link_sensors |= 1 << s
    return usable[BASE] > 0, usable[TORQUE] > 0, link_sensors


def usable_residuals_code_in_python(stream: StreamState) -> int:
    """`usable_residuals_code`, likewise."""
    code = 0
    for usable in stream.usable.tolist():
        code = 2 * code + usable
    return int(code)
