"""Problems with the readings of the last second, as messages for the operator."""

from collections import Counter
from collections.abc import Hashable

from contactsense.service.sensors.checks.held_share import HeldShare
from contactsense.service.sensors.checks.plausibility import Event, SensorEvent

SHARE = 0.02
"""A smaller fraction of lost, repeated or late packets is not reported."""
WITHOUT_WRENCH = 0.05
"""The same for samples without a force/torque reading, which a busy computer misses now and then."""
LOST_READINGS = 0.5
"""The same for lost readings of a force/torque sensor: those before and after make up for fewer. Above
it, none is used."""

_ALWAYS = {
    "not finite": "the robot sends joint positions or velocities that are not numbers",
    "too fast": "the robot sends joint velocities far beyond what its joints can do; such packets are left "
    "out: is the connection to it damaged, or are its joint limits in the scene too low?",
    "bad_stamps": "the robot sends time stamps that are not numbers",
    "jumps": "the robot's time stamps (timestamp) jump or run far ahead of this computer's clock: expected "
    "seconds; are they in milliseconds?",
    "positions frozen": "the robot repeats the same joint positions while its velocities say that it moves: "
    "its packets are stale; restart RTDE on the controller",
    "all frozen": "the robot repeats the same positions, velocities and torques in every packet: its packets "
    "are stale, or the arm is switched off (a simulator without noise needs --constant-readings)",
    "velocities wrong": "the robot's joint velocities are not those with which its joint positions change; "
    "such samples are left out: are they frozen, of another sign or unit, or does the robot's clock run at "
    "another speed?",
    "torque not finite": "the robot sends joint torques that are not numbers; they are left out",
    "torque frozen": "the joint torques never change: is the arm switched off? They are left out (a "
    "simulator without noise needs --constant-readings)",
    "torque zero": "the joint torques are exactly zero in all joints: is the arm switched off? They are left "
    "out (a simulator that has none needs --constant-readings)",
    "torque too large": "the robot sends joint torques far beyond what its joints can apply; "
    "they are left out",
}
_OF_SENSOR = {
    "unaligned": "samples lack the force/torque reading: its clock and the robot's are not aligned yet, "
    "which takes longer on a busy computer",
    "late": "the force/torque readings arrive later than before, compared with the robot's packets; they are "
    "left out: does something between sensor and computer hold them back? If the sensor's counter stood "
    "still, restart the service",
    "robot late": "the robot's packets arrive later than before, compared with the force/torque readings: "
    "does something between robot and computer hold them back? If the robot's clock stood still, restart the "
    "service",
    "not finite": "the force/torque sensor sends values that are not numbers; its readings are left out",
    "zero": "the force/torque sensor reads exactly zero in all six components; its readings are left out: "
    "check its cable and power",
    "frozen": "the force/torque sensor repeats the same reading; its readings are left out: restart it (a "
    "simulator without noise needs --constant-readings)",
}
"""Problems of one force/torque sensor; the message begins with its field of the scene."""
_STUCK = (
    "{field}[{channel}]: this value stays the same while the others change; the whole reading is left out: "
    "is that channel broken, or at the end of its range? (A simulator without noise needs "
    "--constant-readings)"
)
_SHARES = {
    "lost": "up to {share:.0%} of the robot's packets were lost within a second; check the network and the "
    "load of this computer",
    "duplicates": "up to {share:.0%} of the robot's packets within a second repeat the time stamp of the one "
    "before",
    "out_of_order": "up to {share:.0%} of the robot's packets within a second arrived in the wrong order; "
    "late ones are ignored",
}
_LACKING = "up to {share:.0%} of the samples within a second lack the force/torque reading"
_READINGS_LOST = (
    "up to {share:.0%} of the readings within a second were lost on their way from the force/torque sensor; "
    "the others are left out: check its network and the load of this computer"
)


class RecentTrouble:
    """Reports the problems of the last second; shares as long as `HeldShare` holds them."""

    def __init__(self) -> None:
        self._shares: dict[Hashable, HeldShare] = {}

    def describe(self, now: float, counts: Counter[Event], period: float) -> tuple[str, ...]:
        """One line for each problem; those of a force/torque sensor begin with its field of the scene.

        Args:
            now: Time on the host's monotonic clock [s].
            counts: Number of occurrences of each problem within the last second.
            period: Time between two packets of the robot [s].
        """
        found = [text for name, text in _ALWAYS.items() if counts[name] > 2]
        expected = max(counts["packets"], 0.5 / period)
        events = {event for event in (*counts, *self._shares) if isinstance(event, SensorEvent)}
        for field in sorted({event.field for event in events}):
            found += self._of_sensor(now, field, counts, expected)
        for name, text in _SHARES.items():
            if share := self._held(now, name, counts[name] / expected, SHARE):
                found.append(text.format(share=share))
        return tuple(found)

    def _of_sensor(self, now: float, field: str, counts: Counter[Event], expected: float) -> list[str]:
        """One line for each problem of a sensor; `expected` is the number of samples that should have its
        reading."""
        lines = [
            f"{field}: {text}" for what, text in _OF_SENSOR.items() if counts[SensorEvent(field, what)] > 2
        ]
        lines += [
            _STUCK.format(field=field, channel=event.channel)
            for event in sorted(event for event in counts if isinstance(event, SensorEvent))
            if (event.field, event.what) == (field, "stuck") and counts[event] > 2
        ]
        lost, received = (counts[SensorEvent(field, what)] for what in ("lost", "received"))
        share = lost / max(lost + received, 1)
        if share := self._held(now, SensorEvent(field, "lost"), share, LOST_READINGS):
            lines.append(f"{field}: {_READINGS_LOST.format(share=share)}")
        # What is reported by its cause must not be reported again by its share when the cause is over.
        lacking = SensorEvent(field, "lacking")
        share = self._held(now, lacking, 0.0 if lines else counts[lacking] / expected, WITHOUT_WRENCH)
        if share and not lines:
            lines.append(f"{field}: {_LACKING.format(share=share)}")
        return lines

    def _held(self, now: float, event: Event, share: float, limit: float) -> float:
        """The share to report, 0 for none."""
        return self._shares.setdefault(event, HeldShare(limit)).update(now, min(1.0, share))
