"""A sensor's silence counts only where somebody listened."""

import time
from types import SimpleNamespace

import pytest

from contactsense.service.sensors.clients import rtde_client
from contactsense.service.sensors.clients.robot_stream import NS
from contactsense.service.sensors.clients.rtde_client import RtdeStream
from contactsense.service.sensors.clients.silence_timer import SilenceTimer
from tests.service.loopback import rtde_server, until


def silence(*looks: tuple[float, float]) -> float:
    """Silence after looks at these times, each of which was to wait for so long [s]."""
    timer, found = SilenceTimer(0), 0.0
    for now, waited in looks:
        found = timer.nothing(round(now * NS), waited)
    return found


@pytest.mark.parametrize("waited", [0.0, 0.02, 0.5])
def test_looks_without_success_add_up(waited: float) -> None:
    step = max(waited, 0.01)
    assert silence(*((step * (k + 1), waited) for k in range(10))) == pytest.approx(10.0 * step)


def test_a_host_that_stood_still_has_not_listened() -> None:
    assert silence((0.1, 0.1), (5.1, 0.1), (5.2, 0.1)) == pytest.approx(0.1 + 0.2 + 0.1)


def test_what_is_heard_ends_the_silence() -> None:
    timer = SilenceTimer(0)
    assert timer.nothing(NS // 10, 0.1) == pytest.approx(0.1)
    timer.heard(NS // 5)
    assert timer.nothing(3 * NS // 10, 0.1) == pytest.approx(0.1)


def test_a_robot_is_not_mute_because_the_host_stood_still(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first look afterwards finds nothing yet."""
    ahead = 0
    clock = SimpleNamespace(
        monotonic=time.monotonic, sleep=time.sleep, monotonic_ns=lambda: time.monotonic_ns() + ahead
    )
    monkeypatch.setattr(rtde_client, "time", clock)
    with rtde_server() as server:
        stream = RtdeStream(server.host, ("actual_q",), port=server.port)
        try:
            assert until(lambda: stream.poll(0.1))
            while stream.poll(0.0):
                pass
            ahead = 3 * NS
            stream.poll(0.0)
            assert until(lambda: stream.poll(0.1))
            assert (stream.health.failures, stream.health.connections) == (0, 1)
        finally:
            stream.close()
