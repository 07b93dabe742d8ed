"""Readings in pushed samples that cannot be measurements: those of a controller that repeats an old state, or
of a sensor that is off.

A robot's own packets are checked more strictly (`service/sensors/checks/plausibility.py`). At rest pushed
samples may repeat, and single values of them in motion as well: simulators without noise push theirs, too.
"""

import time
from dataclasses import replace

import numpy as np

from contactsense.scene import Scene
from contactsense.sensors.link_values import as_fields, by_field
from contactsense.service.controllers.sample_message import MessageError
from contactsense.service.controllers.sample_times import SampleTimes
from contactsense.service.sensors.checks.plausibility import (
    REST_SPEED,
    RecentCounts,
    RepeatCheck,
    RobotCheck,
    SensorEvent,
)
from contactsense.service.sensors.checks.recent_trouble import WITHOUT_WRENCH
from contactsense.service.sensors.checks.stuck_channels import StuckChannels
from contactsense.service.sensors.checks.velocity_check import VelocityCheck
from contactsense.types import Sample

HELD = 0.0105
"""A reading of an arm that moves may be repeated for this time [s]: sensors may be slower than the
controller, but in motion older readings look like a contact. It is 10 ms, and what rounding makes of them."""
_SAMPLES = "samples"
_TEXTS = {
    "stale": "{field}: the controller repeats the same joint positions while qd says that the arm moves: its "
    "state is stale; such samples are not used",
    "wrong": "{field}: the joint velocities are not those with which the joint positions change; such "
    "samples are not used: are they frozen, of another sign or unit, or are the times not in seconds?",
    "frozen": "{field}: the controller repeats the same reading while the arm moves; it is left out: is the "
    "sensor stuck, or slower than 100 Hz?",
    "stuck": "{field}[{channel}]: this value stays the same while the others change; the whole reading is "
    "left out: is that channel broken, or at the end of its range?",
    "late": "{field}: the times of the samples run back again and again; late ones are not used: "
    "are they sent in the wrong order, or by two clocks?",
    "repeated": "{field}: samples have the time of the one before and are not used: is each sent twice, or "
    "does the clock stand still?",
    "back": "{field}: the times of the samples jump back again and again, and each time the estimation "
    "begins anew: are they sent by two clocks?",
    "zero": "{field}: the reading is exactly zero in all components; it is left out: is the sensor on?",
}


class PushedReadings:
    """Removes such readings from the samples of one stream, and counts them.

    Args:
        scene: The arm and its sensors.
    """

    def __init__(self, scene: Scene) -> None:
        self._recent = RecentCounts()
        self._robot = RobotCheck(np.array([joint.velocity_limit for joint in scene.robot.joints]))
        self._velocities = VelocityCheck(len(scene.robot.joints), late=0.03)
        lengths = {"joint_torque": len(scene.robot.joints)}
        lengths |= dict.fromkeys(("base_wrench", *scene.link_sensors), 6)
        self._repeats = {name: RepeatCheck() for name in lengths}
        # A controller may send a constant for a joint that has no sensor.
        self._channels = {name: StuckChannels(length, from_start=False) for name, length in lengths.items()}
        torque = scene.joint_torque
        # A torque without model is zero where nothing touches, and where there is no noise. So is the wrench
        # on a sensor within the arm that carries nothing.
        self._never_zero = {"base_wrench"}
        if torque is not None and torque.contains == "motor":
            self._never_zero.add("joint_torque")
        self._q: tuple[float, ...] = ()
        self._times = SampleTimes()
        self._at_rest = False

    def checked(self, sample: Sample) -> Sample:
        """The sample without readings that cannot be measurements.

        Raises:
            MessageError: It is late, its positions are stale or its velocities wrong, so that nothing
                of it can be used.
        """
        self._recent.add(time.monotonic(), _SAMPLES)
        self._check_time(sample.t)
        if self._robot.positions_stale(sample.t, sample.q, sample.qd):
            self._note("q", "stale")
            raise MessageError("q", "expected positions that change where qd says that the arm moves")
        if self._velocities.contradict(sample.t, sample.q, sample.qd):
            self._note("qd", "wrong")
            raise MessageError("qd", "expected the velocities with which q changes [rad/s]")
        q = tuple(sample.q.tolist())
        self._at_rest = float(np.abs(sample.qd).max()) <= REST_SPEED
        moves = q != self._q and not self._at_rest
        self._q = q
        links = by_field(sample.wrist_wrench, sample.link_wrenches)
        kept = {field: self._measured(field, wrench, sample.t, moves) for field, wrench in links.items()}
        return replace(
            sample,
            joint_torque=self._measured("joint_torque", sample.joint_torque, sample.t, moves),
            base_wrench=self._measured("base_wrench", sample.base_wrench, sample.t, moves),
            **as_fields(kept),
        )

    @property
    def trouble(self) -> tuple[str, ...]:
        """What was wrong within the last second, one readable line each."""
        counts = self._recent.totals(time.monotonic())
        few = WITHOUT_WRENCH * counts[_SAMPLES]  # readings of a sensor that is now and then late
        return tuple(
            _TEXTS[event.what].format(field=event.field, channel=event.channel)
            for event, count in counts.items()
            if isinstance(event, SensorEvent) and count > max(2, few if event.what == "frozen" else 0.0)
        )

    def _check_time(self, t: float) -> None:
        try:
            if self._times.checked(t):
                self._note("t", "back")
        except MessageError:
            self._note("t", "repeated" if self._times.repeats(t) else "late")
            raise

    def _measured(self, field: str, values: np.ndarray | None, t: float, moves: bool) -> np.ndarray | None:
        """The reading of a sensor, None if it cannot be a measurement."""
        if values is None:
            return None
        reading = tuple(values.tolist())
        repeated = self._repeats[field].update(t, reading)
        if field in self._never_zero and not values.any():
            self._note(field, "zero")
            return None
        if stuck := self._channels[field].update(reading, self._at_rest):
            for channel in stuck:
                self._note(field, "stuck", channel)
            return None
        if not moves or repeated <= HELD or not values.any():
            return values
        self._note(field, "frozen")
        return None

    def _note(self, field: str, what: str, channel: int | None = None) -> None:
        self._recent.add(time.monotonic(), SensorEvent(field, what, channel))
