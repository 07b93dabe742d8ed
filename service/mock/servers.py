"""Serves a recorded motion: RTDE server and Net F/T server with a common clock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contactsense.service.mock.arm.cell import TORQUE_CONSTANTS
from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.interfaces.playback_fields import PlaybackController
from contactsense.service.mock.interfaces.received_log import ReceivedLog
from contactsense.service.mock.interfaces.rtde_server import PORT, RATE, RtdeServer
from contactsense.service.mock.interfaces.sent_log import SentLog
from contactsense.service.mock.playback import Feed, Playback, PlaybackWrench, SimClock


@dataclass(frozen=True, slots=True)
class MockSettings:
    """Addresses and behaviour of the mock. Port 0: any free port."""

    host: str = "127.0.0.1"
    rtde_port: int = PORT
    netft_port: int = 49152
    http_port: int = 49180
    version: tuple[int, int, int, int] = (5, 23, 0, 0)
    """Version of the controller's software: major, minor, bugfix, build."""
    netft_rate: float = 1000.0
    """Force/torque readings per second [Hz]."""
    rtde_delay: float = 0.0
    """Delay between the instant of a robot packet and its sending [s]."""
    netft_delay: float = 0.0
    """Delay between the instant of a force/torque reading and its sending [s]."""
    loop: bool = False
    """Whether to repeat the motion after its end, instead of staying there."""
    sent_log: Path | None = None
    """File with the times at which robot packets left, see `SentLog`."""
    received_log: Path | None = None
    """File with the times at which the registers of reactions were written, see `ReceivedLog`."""


class MockServers:
    """Both servers, running from construction to `close`.

    Args:
        feed: The motion.
        settings: Addresses and behaviour.
        to_sensor: Sensor's reading = `to_sensor` @ base wrench, shape (6, 6).
        torque_constants: Joint torque per motor current for the RTDE field `actual_current`, shape (6,)
            [Nm/A].
        fields: Further RTDE fields, see `Controller`.
        clock: Simulated time; by default it starts now.

    Raises:
        OSError: A port is in use.
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
        """Stop both servers."""
        self.rtde.close()
        self.netft.close()

    def __enter__(self) -> "MockServers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
