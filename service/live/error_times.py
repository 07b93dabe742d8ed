"""When the latest error of each sensor was current."""

from collections.abc import Callable

from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import StreamHealth


class ErrorTimes:
    """Keeps the time of each sensor's latest error, as its text stays after recovery.

    Args:
        now: Current time on the host's clock, ISO 8601 in UTC.
    """

    def __init__(self, now: Callable[[], str]) -> None:
        self._now = now
        self._latest: dict[str, tuple[tuple[str, int], str]] = {}

    def time_of(self, name: str, stream: StreamHealth | WrenchHealth) -> str | None:
        """When the error of a sensor was last the case, as far as it was asked for; None if there is none.

        Args:
            name: Of the sensor.
            stream: Its state now. An error is new if its text or the number of failures has changed; it is
                the case as long as no readings come.
        """
        if not stream.error:
            return None
        count = (
            stream.failures if isinstance(stream, StreamHealth) else stream.reconnects + stream.device_errors
        )
        known = self._latest.get(name)
        if known is None or known[0] != (stream.error, count) or stream.state != "streaming":
            self._latest[name] = (stream.error, count), self._now()
        return self._latest[name][1]
