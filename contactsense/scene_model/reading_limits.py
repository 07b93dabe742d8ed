"""Limits of readings as the kernels test them: a test that ordinary readings pass, in the time of a few
comparisons. What does not pass is checked by `contactsense.plausibility.plausible_limits`, which says what is
wrong."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.spatial import Six, dot6
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor
from contactsense.sensors.usable_sensors import sensors_in

ONE_TURN = 2.0 * math.pi
"""Positions may be this far beyond the joint's limits [rad]: controllers count turns differently."""
LARGEST_COUNT = 1e4
"""Largest position of a joint without limits, which may count turns [rad]."""
TORQUE_SCALE = 1.5
"""A measured torque above this multiple of the joint's limit is implausible: limits are those of the drives,
and motor torques include acceleration and friction of the rotor."""
LARGEST_FORCE, LARGEST_MOMENT = 5000.0, 5000.0
"""Largest wrench of a contact about the base origin, where the sensor states no range [N, Nm].

The force is more than eight times what a joint at its torque limit can push with at the arm's full reach; for
the strongest arms of the library 738 Nm at 1.75 m (UR20) and at 1.3 m (UR30), or 422 N and 568 N. The moment
is more than six times the torque limit. Readings in mN or Nmm are beyond them from 5 N or 5 Nm on."""
SAME = 0.2
"""Wrenches that differ by less than this share of the arm's weight are taken for the same."""
USUAL_PUSH = 80.0
"""What a push of this size explains is plausible [N]: on an arm of 5 kg, one from below leaves a reading as
small as that of a sensor which was tared."""
ROUNDING = 1e-6
"""A reading at its limit is beyond it in spite of being converted to base axes and back."""


class ReadingLimits(NamedTuple):
    """Limits of the joints and of the base sensor."""

    lowest: Annotated[Floats, "joints"]
    """Lowest plausible position of each joint [rad]."""
    highest: Annotated[Floats, "joints"]
    """The highest one [rad]."""
    torque: Annotated[Floats, "joints"]
    """Torque limit of each joint [Nm]."""
    to_reading: Annotated[Floats, "6, 6"]
    """Each component of the base sensor's reading as a row, whose product with the base wrench it is, apart
    from the bias."""
    bias: Annotated[Floats, "6"]
    """Bias of the base sensor [N, Nm]."""
    range: Annotated[Floats, "6"]
    """A reading with a component at or beyond this cannot be used; infinite where it is unknown [N, Nm]."""


def reading_limits(scene: Scene, to_base: np.ndarray) -> ReadingLimits:
    """The limits of a scene.

    Args:
        scene: The scene.
        to_base: Transforms a wrench from the base sensor's frame to base axes about the base origin, shape
            (6, 6).
    """
    joints, sensor = scene.robot.joints, scene.base_wrench or WrenchSensor()
    low, high = np.array([joint.position_limits for joint in joints]).reshape(-1, 2).T
    return ReadingLimits(
        lowest=np.where(np.isfinite(low), low - ONE_TURN, -LARGEST_COUNT),
        highest=np.where(np.isfinite(high), high + ONE_TURN, LARGEST_COUNT),
        torque=np.array([joint.torque_limit for joint in joints]),
        to_reading=sensor.sign_factor * np.linalg.inv(to_base),
        bias=np.array(sensor.bias, dtype=np.float64),
        range=(1.0 - ROUNDING) * sensor.limits,
    )


@inlined_kernel
def are_positions_within(limits: ReadingLimits, q: np.ndarray) -> bool:
    """Whether joint positions, shape (n,) [rad], are plausible."""
    for j in range(q.shape[0]):  # noqa: SIM110 (a generator cannot be compiled)
        if not limits.lowest[j] <= q[j] <= limits.highest[j]:
            return False
    return True


@inlined_kernel
def are_torques_within(limits: ReadingLimits, torque: np.ndarray, scale: float) -> bool:
    """Whether torques, shape (n,) [Nm], are at most `scale` times the joints' limits."""
    for j in range(torque.shape[0]):  # noqa: SIM110 (a generator cannot be compiled)
        if not abs(torque[j]) <= scale * limits.torque[j]:
            return False
    return True


@inlined_kernel
def is_range_known(limits: ReadingLimits) -> bool:
    """Whether the range of the base sensor is known."""
    return bool(limits.range[0] < math.inf)


@inlined_kernel
def is_within_range(limits: ReadingLimits, wrench: np.ndarray | Six) -> bool:
    """Whether the base sensor that reads this wrench, base axes and origin, shape (6,) [N, Nm], is within its
    range."""
    for i in range(6):  # noqa: SIM110 (a generator cannot be compiled)
        if not abs(dot6(limits.to_reading[i], wrench) + limits.bias[i]) < limits.range[i]:
            return False
    return True


@inlined_kernel
def is_sample_plausible(
    limits: ReadingLimits, q: np.ndarray, torque: np.ndarray, base_wrench: np.ndarray, sensor_bits: int
) -> bool:
    """Whether the readings of a stream's sample are surely plausible, apart from link sensors.

    Args:
        limits: Of the scene.
        q, torque, base_wrench: As in `contactsense.types.Sample`.
        sensor_bits: Which sensors have a value, see `contactsense.sensors.usable_sensors.sensor_bits_of`.
    """
    has_base, has_torque, _ = sensors_in(sensor_bits)
    return (
        are_positions_within(limits, q)
        and (not has_torque or are_torques_within(limits, torque, TORQUE_SCALE))
        and (not has_base or not is_range_known(limits) or is_within_range(limits, base_wrench))
    )


@inlined_kernel
def is_contact_wrench(wrench: np.ndarray, weight: np.ndarray) -> bool:
    """Whether a wrench, shape (6,) [N, Nm], can be that of a contact; `weight`: gravity wrench of the arm."""
    size = math.sqrt(weight[0] ** 2 + weight[1] ** 2 + weight[2] ** 2)
    for i in range(6):  # noqa: SIM110 (a generator cannot be compiled)
        if not abs(wrench[i]) < (LARGEST_FORCE if i < 3 else LARGEST_MOMENT) + size:
            return False
    return True


@inlined_kernel
def _six(wrench: np.ndarray) -> Six:
    return wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]


@inlined_kernel
def _sum(a: np.ndarray, b: np.ndarray) -> Six:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@inlined_kernel
def is_base_plausible(limits: ReadingLimits, wrench: np.ndarray, weight: np.ndarray, external: bool) -> bool:
    """Whether the base wrench of a single measurement is surely plausible: within the sensor's range, and not
    the arm's own weight where that should be subtracted, nor without it where it should not, nor the opposite
    of its weight.

    Args:
        limits: Of the scene.
        wrench: The base wrench, shape (6,) [N, Nm].
        weight: Gravity wrench of the arm in this posture, shape (6,) [N, Nm].
        external: Whether the weight has been subtracted.
    """
    if is_range_known(limits):
        if not is_within_range(limits, _sum(wrench, weight) if external else _six(wrench)):
            return False
    elif not is_contact_wrench(wrench, weight):
        return False
    zero, same, opposite = 0.0, 0.0, 0.0
    for i in range(3):
        zero += wrench[i] ** 2
        same += (wrench[i] - weight[i]) ** 2
        opposite += (wrench[i] + weight[i]) ** 2
    size = math.sqrt(weight[0] ** 2 + weight[1] ** 2 + weight[2] ** 2)
    nearest = min(same if external else zero, opposite)
    return bool(nearest >= (SAME * size) ** 2)
