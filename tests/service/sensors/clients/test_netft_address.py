"""A force/torque sensor that is given by its name: its address may change while the service runs."""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pynetft
import pytest

from contactsense.service.mock.interfaces.netft_server import NetFtServer
from contactsense.service.mock.playback import SimClock
from contactsense.service.sensors.clients import host_names
from contactsense.service.sensors.clients.netft_client import NetFtStream
from contactsense.service.sensors.clients.robot_stream import SensorError
from tests.service.loopback import own_address, until

COUNTS = (1e6, 1e6)


@contextmanager
def sensor(host: str, port: int = 0) -> Iterator[NetFtServer]:
    with NetFtServer(lambda t: np.full(6, t), SimClock(), host=host, port=port) as server:
        yield server


@pytest.fixture
def _looked_up_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host_names, "RETRY", 0.0)


def resolver(address: Callable[[], str]) -> Callable[..., list[object]]:
    return lambda *_: [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address(), 0))]


@pytest.mark.usefixtures("_looked_up_at_once")
def test_a_sensor_is_followed_to_its_new_address(monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = own_address(), own_address()
    addresses = [old]
    monkeypatch.setattr(socket, "getaddrinfo", resolver(lambda: addresses[-1]))
    with sensor(old) as server:
        stream = NetFtStream("sensor.cell", port=server.port, counts=COUNTS)
        assert until(stream.poll)
        port = server.port
    before = stream.health.received
    addresses.append(new)
    with sensor(new, port):
        assert until(lambda: stream.poll() and stream.health.received > before)
        assert stream.health.error == (
            f"force/torque sensor at sensor.cell:{port} has another address: expected {old}, got {new}"
        )
        stream.close()
        assert stream.poll() == []


@pytest.mark.usefixtures("_looked_up_at_once")
def test_a_sensor_is_read_at_its_old_address_if_its_name_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    host, asked = own_address(), 0
    resolvable = True

    def look_up() -> str:
        nonlocal asked
        asked += 1
        if not resolvable:
            raise socket.gaierror(-3, "Temporary failure in name resolution")
        return host

    monkeypatch.setattr(socket, "getaddrinfo", resolver(look_up))
    with sensor(host) as server:
        stream = NetFtStream("sensor.cell", port=server.port, counts=COUNTS)
        assert until(stream.poll)
        server.mute, resolvable, before = True, False, asked
        assert until(lambda: stream.poll() == [] and asked > before + 1)
        server.mute = False
        assert until(stream.poll)
        stream.close()


def test_a_client_that_cannot_be_started_is_told_and_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise RuntimeError("Resource temporarily unavailable")

    host = own_address()
    with sensor(host) as server:
        with monkeypatch.context() as patch:
            patch.setattr(pynetft.Client, "start", refuse)
            stream = NetFtStream(host, port=server.port, counts=COUNTS)
            assert stream.poll() == []
        assert stream.health.state == "waiting"
        assert stream.health.error.endswith("cannot be started: Resource temporarily unavailable")
        assert until(stream.poll)
        stream.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "sensor.cell"])
def test_an_invalid_port_is_refused_at_once(host: str) -> None:
    with pytest.raises(SensorError, match=f"force/torque sensor at {host}:70000: rdt_port must be"):
        NetFtStream(host, port=70_000)
