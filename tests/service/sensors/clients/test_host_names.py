"""Names become addresses without anybody waiting for the resolver."""

import socket
import time

import pytest

from contactsense.service.sensors.clients.host_names import HostName
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.clients.rtde_client import RtdeStream
from tests.service.loopback import until


def test_an_address_needs_no_resolver(monkeypatch):
    monkeypatch.setattr(socket, "getaddrinfo", None)
    assert HostName("192.0.2.1").address() == "192.0.2.1"


def test_a_name_is_resolved_in_the_background():
    name = HostName("localhost")
    assert until(lambda: name.address() == "127.0.0.1")


def refuses(name, text):
    try:
        name.address()
    except SensorError as error:
        return text in str(error)
    return False


def test_a_name_that_does_not_exist_is_told():
    name = HostName("no-such-robot.invalid")
    assert until(lambda: refuses(name, "no-such-robot.invalid cannot be resolved"))


def test_a_resolver_that_does_not_answer_holds_up_nobody(monkeypatch):
    def mute(*_):
        time.sleep(1.0)
        raise socket.gaierror(-3, "Temporary failure in name resolution")

    monkeypatch.setattr(socket, "getaddrinfo", mute)
    monkeypatch.setattr("contactsense.service.sensors.clients.host_names.PATIENCE", 0.3)
    stream = RtdeStream("robot.cell", ("actual_q",))
    longest = 0.0
    deadline = time.monotonic() + 5.0
    while "no answer from the resolver" not in stream.health.error:
        assert time.monotonic() < deadline
        begin = time.monotonic()
        assert stream.poll(0.02) == []
        longest = max(longest, time.monotonic() - begin)
    assert stream.health.state == "waiting"
    assert longest < 0.5  # the look-up takes a second
    stream.close()


@pytest.mark.parametrize("host", ["", "a" * 300, "robot..cell"])
def test_a_name_that_cannot_be_one_is_told(host):
    name = HostName(host)
    assert until(lambda: refuses(name, "cannot be resolved"))
