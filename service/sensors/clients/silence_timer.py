"""Measures how long a sensor has been silent although somebody listened.

A host that stands still, as a virtual machine does whose processor is taken away, hears nothing meanwhile.
What was sent waits in its queues, and is there a moment after it goes on: such a time is no silence of the
sensor.
"""

from contactsense.service.sensors.clients.robot_stream import NS

_LATE = 0.1
"""If a look takes longer by more than this than it was to wait, the rest is our own delay [s]."""


class SilenceTimer:
    """Silence of one sensor, measured from look to look.

    Args:
        now_ns: Time on the host's monotonic clock [ns].
    """

    def __init__(self, now_ns: int) -> None:
        self._looked_ns = now_ns
        self._silent_ns = 0

    def heard(self, now_ns: int) -> None:
        """The sensor has sent something."""
        self._looked_ns, self._silent_ns = now_ns, 0

    def nothing(self, now_ns: int, waited: float) -> float:
        """Nothing was there at a look that was to wait for so long [s].

        Returns:
            The silence until now [s].
        """
        self._silent_ns += min(now_ns - self._looked_ns, round((waited + _LATE) * NS))
        self._looked_ns = now_ns
        return self._silent_ns / NS
