"""Implausible measurements: mistaken units, values that no joint and no sensor reaches."""

from collections.abc import Mapping
from math import dist, isfinite, isinf
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.scene import Scene
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.load_weight import LoadWeight
from contactsense.scene_model.reading_limits import (
    LARGEST_FORCE,
    LARGEST_MOMENT,
    ROUNDING,
    SAME,
    TORQUE_SCALE,
    USUAL_PUSH,
    reading_limits,
)
from contactsense.sensors.settings import COMPONENTS, WrenchSensor

_WEIGHT_LEVER = 0.5
"""Moments are compared with the arm's weight at this lever [m]."""
_TURNED = " with the opposite sign (base_wrench.sign)"
_NO_FORCE = [0.0, 0.0, 0.0]


class Implausible(NamedTuple):
    """Why a measurement is implausible."""

    field: str
    reason: str
    """What was expected, and what was received."""


class _RangedSensor(NamedTuple):
    """A link sensor whose range is known."""

    frame: LinkSensorFrame
    load: LoadWeight
    limits: list[float]
    """Of each component of its reading [N, Nm]."""


class PlausibleLimits:
    """Limits of the measurements of one scene."""

    def __init__(self, scene: Scene) -> None:
        """Take limits of joints and sensors from `scene`."""
        self._joint_names = [joint.name for joint in scene.robot.joints]
        self.sensor = scene.base_wrench or WrenchSensor()
        """The base sensor."""
        limits = reading_limits(
            scene, wrench_transform(self.sensor.rotation, np.array(self.sensor.translation))
        )
        # Single samples are compared as numbers: for so few of them, that is faster than as arrays. What is
        # within the limits of all joints and components needs no comparison with each.
        self._lowest, self._highest = limits.lowest.tolist(), limits.highest.tolist()
        self._torque: list[float] = limits.torque.tolist()
        self.weight = ArmWeight(scene)
        """Weight of arm and tool."""
        self._range: list[float] = limits.range.tolist()
        self._bias, self._to_reading = limits.bias, limits.to_reading.T
        self._links = {
            field: _RangedSensor(
                LinkSensorFrame(scene, field),
                LoadWeight(scene, field),
                ((1.0 - ROUNDING) * sensor.limits).tolist(),
            )
            for field, sensor in scene.link_sensors.items()
            if sensor.range is not None
        }
        weight = float(np.linalg.norm(self.weight.force))
        self._largest = [LARGEST_FORCE + weight] * 3 + [LARGEST_MOMENT + weight] * 3
        self._weight, self._weight_force = weight, self.weight.force.tolist()
        self._opposite_force = [-value for value in self._weight_force]
        self._lowest_of_all, self._highest_of_all = max(self._lowest), min(self._highest)
        self._least_torque = min(self._torque)

    def position(self, q: np.ndarray) -> Implausible | None:
        """Whether joint positions q, shape (n,) [rad], are beyond limits and one turn."""
        values = q.tolist()
        if min(values) >= self._lowest_of_all and max(values) <= self._highest_of_all:
            return None
        for name, value, low, high in zip(
            self._joint_names, values, self._lowest, self._highest, strict=True
        ):
            if isinf(value):
                return Implausible("q", f"expected finite positions, got {value} for {name}")
            if value < low or value > high:
                return Implausible(
                    "q",
                    f"expected positions in rad, {name} within {low:.4g} to {high:.4g}, got {value:.6g}; "
                    "are they in degrees?",
                )
        return None

    def torque(self, torque: np.ndarray, scale: float = TORQUE_SCALE) -> Implausible | None:
        """Whether torques, shape (n,) [Nm], exceed `scale` times the joints' limits."""
        values, least = torque.tolist(), scale * self._least_torque
        if -least <= min(values) and max(values) <= least:
            return None
        for name, value, limit in zip(self._joint_names, values, self._torque, strict=True):
            if abs(value) > scale * limit:
                return Implausible(
                    "joint_torque",
                    f"expected at most {scale:g} times the {limit:g} Nm of {name}, got {value:.6g} Nm",
                )
        return None

    @property
    def of_all_joints(self) -> tuple[float, float, float]:
        """Lowest and highest position [rad] and largest torque [Nm] that are plausible for every joint."""
        return self._lowest_of_all, self._highest_of_all, TORQUE_SCALE * self._least_torque

    def saturation(self, wrench: np.ndarray) -> Implausible | None:
        """Whether the base sensor that reads this wrench, base axes and origin, shape (6,) [N, Nm], is at or
        beyond its range. One that is not finite is not: whoever uses it refuses it anyway."""
        if self.sensor.range is None or not _is_finite(wrench):
            return None
        reading = wrench @ self._to_reading + self._bias
        return _first("base_wrench", reading, self._range, "a reading within the sensor's range")

    @property
    def has_link_range(self) -> bool:
        """Whether the scene states the range of a link sensor."""
        return bool(self._links)

    def link_saturation(self, field: str, q: np.ndarray, wrench: np.ndarray) -> Implausible | None:
        """The same for a link sensor, a key of `Scene.link_sensors`, in the posture q, shape (n,) [rad]."""
        sensor = self._links.get(field)
        if sensor is None or not _is_finite(wrench):
            return None
        reading = sensor.frame.reading(q, wrench)
        return _first(field, reading, sensor.limits, "a reading within the sensor's range")

    def request(
        self,
        q: np.ndarray,
        base_wrench: np.ndarray | None,
        joint_torque: np.ndarray | None,
        links: Mapping[str, np.ndarray],
        external: bool,
    ) -> Implausible | None:
        """The first of the arguments of `Localizer.locate` that is implausible; `links`: values of the link
        sensors by field."""
        found = self.position(q)
        if found is None and joint_torque is not None:
            # What remains of a plausible torque after a plausible model's is subtracted.
            found = self.torque(joint_torque, TORQUE_SCALE + 1.0 if external else TORQUE_SCALE)
        if found is None and base_wrench is not None:
            found = self._base(q, base_wrench, external)
        for field, wrench in links.items():
            if found is not None:
                return found
            sensor = self._links.get(field)
            if sensor is None:
                found = _first(field, wrench, self._largest, "the wrench of a contact")
            else:
                raw = wrench + sensor.load.wrench(q) if external else wrench
                found = self.link_saturation(field, q, raw)
        return found

    def suspects(
        self,
        q: np.ndarray,
        base_wrench: np.ndarray | None,
        joint_torque: np.ndarray | None,
        links: Mapping[str, np.ndarray],
        external: bool,
    ) -> np.ndarray:
        """Indices of those of N measurements, arrays as in `request` with a leading axis N, that may be
        implausible: only these need `request`."""
        found = self.positions_beyond(q)
        if joint_torque is not None:
            found |= self.torques_beyond(joint_torque)
        largest = (1.0 - ROUNDING) * np.array(self._largest)
        for wrench in (base_wrench, *links.values()):
            if wrench is not None:
                found |= _rows_beyond(wrench, -largest, largest)
        if base_wrench is not None:
            weight = self.weight.force
            for other in (weight if external else np.zeros(3), -weight):
                # By column: sums over rows of three take several times as long.
                x, y, z = (base_wrench[:, i] - other[i] for i in range(3))
                with np.errstate(over="ignore"):
                    found |= x * x + y * y + z * z < (SAME * self._weight) ** 2
            found |= self.sensor.range is not None
        found |= any(field in self._links for field in links)
        return np.flatnonzero(found)

    def positions_beyond(self, q: np.ndarray) -> np.ndarray:
        """Which of N positions, shape (N, n) [rad], `position` finds, shape (N,), bool."""
        return _rows_beyond(q, np.array(self._lowest), np.array(self._highest))

    def torques_beyond(self, torque: np.ndarray) -> np.ndarray:
        """Which of N torques, shape (N, n) [Nm], `torque` finds, shape (N,), bool."""
        limit = TORQUE_SCALE * np.array(self._torque)
        return _rows_beyond(torque, -limit, limit)

    def saturated(self, wrench: np.ndarray) -> np.ndarray:
        """Which of N base wrenches, shape (N, 6) [N, Nm], `saturation` finds, shape (N,), bool."""
        if self.sensor.range is None:
            return np.zeros(len(wrench), dtype=bool)
        with np.errstate(invalid="ignore"):
            beyond = np.abs(wrench @ self._to_reading + self._bias) >= self._range
        return np.asarray(beyond.any(axis=1) & np.isfinite(wrench).all(axis=1))

    def link_saturated(self, field: str, q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Which of N wrenches on a link sensor, shape (N, 6) [N, Nm], in postures of shape (N, n) [rad],
        `link_saturation` finds, shape (N,), bool."""
        sensor = self._links.get(field)
        if sensor is None:
            return np.zeros(len(q), dtype=bool)
        with np.errstate(invalid="ignore"):
            beyond = np.abs(sensor.frame.readings(q, wrench)) >= sensor.limits
        return np.asarray(beyond.any(axis=1) & np.isfinite(wrench).all(axis=1))

    def _base(self, q: np.ndarray, wrench: np.ndarray, external: bool) -> Implausible | None:
        if self.sensor.range is None:
            found = _first("base_wrench", wrench, self._largest, "the wrench of a contact")
        else:
            found = self.saturation(wrench + self.weight.wrench(q) if external else wrench)
        if found is not None:
            return found
        force, weight = wrench[:3].tolist(), self._weight_force
        if external:
            for sign, other, turned in ((1.0, weight, ""), (-1.0, self._opposite_force, _TURNED)):
                if self._is_near(force, other) and self._is_own_weight(q, sign * wrench):
                    return Implausible(
                        "base_wrench",
                        "expected the contact's share alone, as external is true, got the arm's own weight "
                        f"of {self._weight:.0f} N{turned}; for raw readings external must be false",
                    )
            return None
        if self._is_near(force, _NO_FORCE) and dist(force, weight) > USUAL_PUSH:
            advice = (
                "is the sensor tared (base_wrench.bias), or is the weight subtracted (external must be true)?"
            )
        elif self._is_near(force, self._opposite_force):
            advice = "it has the opposite sign (base_wrench.sign)"
        else:
            return None
        return Implausible(
            "base_wrench",
            f"expected a raw reading with the arm's weight, force {in_words(self.weight.force)} N, "
            f"got {in_words(wrench[:3])} N; {advice}",
        )

    def _is_near(self, force: list[float], other: list[float]) -> bool:
        """Whether two forces differ by little compared with the arm's weight."""
        return dist(force, other) < SAME * self._weight

    def _is_own_weight(self, q: np.ndarray, wrench: np.ndarray) -> bool:
        """Whether a wrench is that of the arm's own weight. Only a push of that size on the vertical through
        the arm's centre of mass looks the same."""
        moment = np.linalg.norm(wrench[3:] - self.weight.wrench(q)[3:])
        return bool(moment < SAME * self._weight * _WEIGHT_LEVER)


def _first(field: str, wrench: np.ndarray, limits: list[float], what: str) -> Implausible | None:
    """The first component of a wrench, shape (6,), at or beyond its limit [N, Nm]."""
    values, least = wrench.tolist(), min(limits)
    if -least < min(values) and max(values) < least:
        return None
    for name, value, limit in zip(COMPONENTS, values, limits, strict=True):
        if abs(value) >= limit:
            unit = "N" if name[0] == "f" else "Nm"
            return Implausible(
                field, f"expected {what}, below {limit:.4g} {unit} in {name}, got {value:.6g} {unit}"
            )
    return None


def _is_finite(wrench: np.ndarray) -> bool:
    return isfinite(sum(wrench.tolist()))


def _rows_beyond(values: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Which of N rows, shape (N, k), have a value below `lowest` or above `highest`, shape (k,); shape (N,),
    bool.

    Mostly none has: to ask for any value of all takes a fraction of the time.
    """
    beyond = (values < lowest) | (values > highest)
    return np.asarray(beyond.any(axis=1)) if beyond.any() else np.zeros(len(values), dtype=bool)


def in_words(force: np.ndarray) -> str:
    """A force, shape (3,) [N], to a tenth of a newton."""
    numbers = (value + 0.0 for value in np.round(force, 1).tolist())
    return f"({', '.join(f'{value:.1f}' if abs(value) < 1e6 else f'{value:.3g}' for value in numbers)})"
