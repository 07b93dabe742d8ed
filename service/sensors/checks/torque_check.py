"""Which joint torques of a robot's packets cannot be measurements."""

import time

import numpy as np

from contactsense.service.sensors.checks.plausibility import (
    REPEAT_LIMIT,
    RecentCounts,
    RepeatCheck,
    SensorEvent,
)
from contactsense.service.sensors.checks.stuck_channels import ArmState, StuckChannels
from contactsense.service.wire.recipe import Number

_SCALE = 1.5
"""A torque larger than this multiple of the joint's limit is invalid."""


class TorqueCheck:
    """Finds torques that are zero, repeated, stuck, or larger than the drives can exert.

    Args:
        limits: Largest torque of each joint, shape (n,) [Nm]; infinite if unknown.
        recent: Counts of what was found.
        arm: Whether the arm is at rest.
    """

    def __init__(self, limits: np.ndarray, recent: RecentCounts, arm: ArmState) -> None:
        self._largest = _SCALE * limits
        self._recent, self._arm = recent, arm
        self._repeats = RepeatCheck()
        self._channels = StuckChannels(len(limits), from_start=True)

    def believes(self, t: float, raw: tuple[Number, ...], torque: np.ndarray | None) -> bool:
        """Whether the joint torques can be measurements.

        Args:
            t: Time on the robot's clock [s].
            raw: Their values as received.
            torque: The torques [Nm], shape (n,); None: they are no numbers.
        """
        now = time.monotonic()
        repeated = self._repeats.update(t, raw)
        if not any(raw):
            self._recent.add(now, "torque zero")
            return False
        # What is subtracted from measured currents is computed by the controller, and may stay the same.
        stuck = self._channels.update(raw[: len(self._largest)], self._arm.at_rest)
        for joint in stuck:
            self._recent.add(now, SensorEvent("joint_torque", "stuck", joint))
        if repeated > REPEAT_LIMIT:
            self._recent.add(now, "torque frozen")
        if repeated > 0.0 or stuck:
            return False
        if torque is not None and (np.abs(torque) > self._largest).any():
            self._recent.add(now, "torque too large")
            return False
        return True
