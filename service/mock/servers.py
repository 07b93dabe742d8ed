"""A recorded motion on the wire: RTDE server and Net F/T server, on one clock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contactsense.service.mock.cell import TORQUE_CONSTANTS
from contactsense.service.mock.netft_server import NetFtServer
from contactsense.service.mock.playback import Feed, Playback, PlaybackWrench, SimClock
from contactsense.service.mock.playback_controller import PlaybackController
from contactsense.service.mock.received_log import ReceivedLog
from contactsense.service.mock.rtde_server import RATE, RtdeServer
from contactsense.service.mock.sent_log import SentLog


@dataclass(frozen=True, slots=True)
class MockSettings:
    """Where the mock listens and how it behaves. Port 0: any free one."""

    host: str = "127.0.0.1"
    rtde_port: int = 30004
    netft_port: int = 49152
    http_port: int = 49180
    version: tuple[int, int, int, int] = (5, 23, 0, 0)
    """Version of the controller's software: major, minor, bugfix, build."""
    netft_rate: float = 1000.0
    """Force/torque readings a second [Hz]."""
    rtde_delay: float = 0.0
    """How much later than its instant a robot packet leaves [s]."""
    netft_delay: float = 0.0
    """How much later than its instant a force/torque reading leaves [s]."""
    loop: bool = False
    """Begin the motion anew after its end, instead of staying there."""
    sent_log: Path | None = None
    """File through which the times at which robot packets left are shared."""
    received_log: Path | None = None
    """File through which the times at which reactions' registers were written are shared."""


class MockServers:
    """Both servers, running from construction to `close`.

    Args:
        feed: The motion.
        settings: Where to listen.
        to_sensor: Sensor's reading = `to_sensor` @ base wrench, shape (6, 6).
        torque_constants: Newton metres per ampere, for the RTDE field `actual_current`, shape (6,).
        fields: Further RTDE fields, see `Controller`.
        clock: Simulated time; default: it begins now.

    Raises:
        OSError: A port is taken.
    """

    def __init__(
        self,
        feed: Feed,
        settings: MockSettings | None = None,
        *,
        to_sensor: np.ndarray | None = None,
        torque_constants: Sequence[float] = TORQUE_CONSTANTS,
        fields: Mapping[str, np.ndarray] | None = None,
        clock: SimClock | None = None,
    ) -> None:
        chosen = settings or MockSettings()
        self.clock = clock or SimClock()
        playback = Playback(feed, loop=chosen.loop)
        controller = PlaybackController(
            feed, playback, version=chosen.version, torque_constants=torque_constants, fields=fields
        )
        self.sent = SentLog(chosen.sent_log, rate=RATE, t0=float(feed.t[0]))
        self.rtde = RtdeServer(
            controller,
            self.clock,
            host=chosen.host,
            port=chosen.rtde_port,
            delay=chosen.rtde_delay,
            sent=self.sent,
            received=None
            if chosen.received_log is None
            else ReceivedLog(chosen.received_log, rate=RATE, t0=float(feed.t[0])),
        )
        try:
            self.netft = NetFtServer(
                PlaybackWrench(feed, playback, to_sensor),
                self.clock,
                host=chosen.host,
                port=chosen.netft_port,
                http_port=chosen.http_port,
                rate=chosen.netft_rate,
                delay=chosen.netft_delay,
            )
        except BaseException:
            self.rtde.close()
            raise

    def close(self) -> None:
        """Stop both."""
        self.rtde.close()
        self.netft.close()

    def __enter__(self) -> "MockServers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
