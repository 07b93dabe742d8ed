"""The connection that writes a controller's inputs."""

import socket
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import pytest

from contactsense.service.reactions.rtde_inputs import RtdeInputs, _advice
from contactsense.service.wire import rtde as wire
from tests.service.loopback import rtde_server
from tests.service.reactions.listener_play import poll_until


def test_a_controller_that_is_away_is_told_and_found_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    inputs = RtdeInputs("127.0.0.1", port, {"a": ["input_int_register_47"]})
    deadline = time.monotonic() + 60.0
    while not inputs.error:
        assert time.monotonic() < deadline
        inputs.poll(time.monotonic())
        time.sleep(0.002)
    assert (
        inputs.error == f"RTDE inputs of the robot at 127.0.0.1:{port}: cannot be reached: Connection refused"
    )
    with rtde_server(port=port) as server:
        while not inputs.ready:
            assert time.monotonic() < deadline
            inputs.poll(time.monotonic())
            time.sleep(0.002)
        assert not inputs.error
        assert inputs.write("a", [5])
        while server.controller.inputs.get("input_int_register_47") != (5,):
            assert time.monotonic() < deadline
            time.sleep(0.002)
    inputs.close()


def test_a_mute_controller_blocks_nobody() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        inputs = RtdeInputs("127.0.0.1", mute.getsockname()[1], {"a": ["input_int_register_47"]})
        poll_until(inputs, lambda: inputs._connected)
        heard = inputs._heard
        inputs.poll(heard + 1.9)
        assert inputs.error == ""
        inputs.poll(heard + 2.1)
        assert "no answer in time" in inputs.error
        inputs.close()


def test_the_time_for_an_answer_begins_once_the_connection_is_open() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        inputs = RtdeInputs("127.0.0.1", mute.getsockname()[1], {"a": ["input_int_register_47"]})
        for now in (1000.0, 1001.9, 1003.8):  # begun, open, waiting
            inputs.poll(now)
            assert inputs.error == ""
        inputs.poll(1004.0)
        assert inputs.error.endswith(": no answer in time")
        inputs.close()


def test_a_connection_that_does_not_open_is_given_up() -> None:
    """As of a controller that is switched off: nobody refuses it."""
    with socket.create_server(("127.0.0.1", 0), backlog=0) as full, ExitStack() as others:
        for _ in range(3):
            other = others.enter_context(socket.socket())
            other.setblocking(False)
            other.connect_ex(full.getsockname())
        inputs = RtdeInputs("127.0.0.1", full.getsockname()[1], {"a": ["input_int_register_47"]})
        for now in (1000.0, 1001.9):
            inputs.poll(now)
            assert (inputs.error, inputs._connected) == ("", False)
        inputs.poll(1002.1)
        assert inputs.error.endswith(": cannot be reached: no answer in time")


class Controller:
    """A controller that answers as a test says, and what it was asked for."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self._decoder = connection, wire.FrameDecoder()
        connection.settimeout(0.05)
        self.requests: list[wire.Request] = []

    def answer(self, *replies: wire.Reply) -> None:
        self.send(b"".join(map(wire.encode, replies)))

    def send(self, data: bytes) -> None:
        self._connection.sendall(data)

    def close(self) -> None:
        """Close the connection when all that came has been read."""
        self.setups()
        self._connection.close()

    def reset(self) -> None:
        """Close the connection without a farewell."""
        self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._connection.close()

    def setups(self) -> int:
        """How often inputs were asked for until now."""
        with suppress(TimeoutError):
            while chunk := self._connection.recv(65536):
                self._decoder.feed(chunk)
        while (frame := self._decoder.next_frame()) is not None:
            self.requests.append(wire.parse_request(frame))
        return sum(isinstance(request, wire.InputSetup) for request in self.requests)


@contextmanager
def connected(outputs: Sequence[str] = ()) -> Iterator[tuple[RtdeInputs, Controller]]:
    """Inputs and a controller that has accepted their connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        inputs = RtdeInputs("127.0.0.1", port, {"a": ["input_int_register_47"]}, outputs)
        poll_until(inputs, lambda: inputs._socket is not None)
        connection, _ = server.accept()
        with connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            yield inputs, Controller(connection)
        inputs.close()


def test_a_recipe_that_was_refused_is_asked_for_again_once_a_second() -> None:
    with connected() as (inputs, controller):
        controller.answer(
            wire.ProtocolVersionReply(True),
            wire.SetupReply(True, 0, ("IN_USE",)),
            wire.SetupReply(False, 1, ("DOUBLE",)),
            wire.StartReply(True),
        )
        begin = time.monotonic()

        def poll(after: float, condition: Callable[[], bool]) -> None:
            """Poll at that time [s], which does not pass, until a condition holds."""
            deadline = time.monotonic() + 60.0
            while not condition():
                assert time.monotonic() < deadline
                inputs.poll(begin + after)

        poll(0.0, lambda: bool(inputs.refused) and inputs._output is not None)
        for after, asked in ((0.9, 1), (1.1, 2), (1.9, 2)):
            for _ in range(3):
                inputs.poll(begin + after)
            assert controller.setups() == asked
        controller.answer(wire.SetupReply(True, 7, ("INT32",)))
        poll(1.9, lambda: inputs.ready)
        assert not inputs.refused
        for _ in range(3):
            inputs.poll(begin + 3.1)
        assert (controller.setups(), inputs.error) == (2, "")


OTHERS = (
    "take others in the rules' file: int and double 24 to 47 (ur_rtde may use 24 and 42 to 46), "
    "bits 64 to 127"
)
ONE_SLIDER = "there is only one speed slider: use registers and let the robot program slow down"


@pytest.mark.parametrize(
    ("not_found", "in_use", "advice"),
    [
        ([], ["input_bit_register_64"], ["IN_USE: another client writes input_bit_register_64", OTHERS]),
        (["input_int_register_47"], [], ["the controller does not know input_int_register_47", OTHERS]),
        ([], ["speed_slider_mask"], ["IN_USE: another client writes speed_slider_mask", ONE_SLIDER]),
        (["a"], ["b", "c"], ["IN_USE: another client writes b, c", "the controller does not know a"]),
    ],
)
def test_why_inputs_are_refused_and_what_to_do(
    not_found: list[str], in_use: list[str], advice: list[str]
) -> None:
    assert _advice(wire.RtdeFieldError(not_found, in_use)) == "; ".join(advice)


def granted(inputs: RtdeInputs, controller: Controller) -> None:
    """Let a controller accept all that is asked for."""
    controller.answer(
        wire.ProtocolVersionReply(True),
        wire.SetupReply(True, 7, ("INT32",)),
        wire.SetupReply(False, 1, ("DOUBLE",)),
        wire.StartReply(True),
    )
    poll_until(inputs, lambda: inputs.ready)


def test_a_write_on_a_connection_that_was_reset_is_told_to_be_none() -> None:
    with connected() as (inputs, controller):
        granted(inputs, controller)
        assert inputs._socket is not None
        assert inputs._socket.getsockopt(
            socket.IPPROTO_TCP, socket.TCP_NODELAY
        )  # registers are shown at once
        assert inputs.write("a", [5])
        controller.reset()
        assert not inputs.write("a", [6])
        assert "Connection reset by peer" in inputs.error
        assert not inputs.can_write("a")
        inputs.poll(time.monotonic() + 1.1)
        assert inputs._socket is not None  # it is tried again


def test_a_controller_that_does_not_read_is_told_and_left() -> None:
    """Half a message was sent: what follows would be taken for the rest of it."""
    with connected() as (inputs, controller):
        granted(inputs, controller)
        assert inputs._socket is not None
        inputs._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        deadline = time.monotonic() + 60.0
        while inputs.write("a", [5]):
            assert time.monotonic() < deadline
        assert "the controller does not read what is written" in inputs.error
        assert not inputs.can_write("a")


def test_a_message_of_which_only_a_part_was_taken_is_told_to_be_none(monkeypatch: pytest.MonkeyPatch) -> None:
    with connected() as (inputs, controller):
        granted(inputs, controller)
        send = socket.socket.send
        with monkeypatch.context() as patch:
            patch.setattr(socket.socket, "send", lambda to, data: send(to, data[:3]))
            assert not inputs.write("a", [5])
        assert "the controller does not read what is written" in inputs.error


def test_a_connection_that_the_controller_closes_is_told_at_once() -> None:
    with connected() as (inputs, controller):
        granted(inputs, controller)
        controller.close()
        poll_until(inputs, lambda: bool(inputs.error))
        assert inputs.error.endswith(": the controller closed the connection")


def test_data_before_their_recipe_are_left_out() -> None:
    with connected() as (inputs, controller):
        controller.send(struct.pack(">HBBd", 12, wire.DATA, 1, 0.5))
        granted(inputs, controller)
        assert not inputs.values
        controller.send(struct.pack(">HBBd", 12, wire.DATA, 1, 0.5))
        poll_until(inputs, lambda: inputs.values == {"timestamp": 0.5})


def test_a_controller_that_falls_silent_is_told_and_left() -> None:
    """One that hangs takes what is written for a while, and does nothing with it."""
    with connected() as (inputs, controller):
        granted(inputs, controller)
        heard = inputs._heard
        inputs.poll(heard + 1.9)
        assert inputs.can_write("a")
        inputs.poll(heard + 2.1)
        assert inputs.error.endswith(": no answer in time")
        assert not inputs.can_write("a")
        assert not inputs.write("a", [5])


@pytest.mark.parametrize(
    ("replies", "why"),
    [
        ([wire.ProtocolVersionReply(False)], "it does not speak RTDE version 2"),
        ([wire.ProtocolVersionReply(True), wire.StartReply(False)], "it refuses to start"),
    ],
)
def test_what_a_controller_refuses_is_told_and_tried_again(replies: list[wire.Reply], why: str) -> None:
    with connected() as (inputs, controller):
        begin = time.monotonic()
        controller.answer(*replies)
        poll_until(inputs, lambda: bool(inputs.error))
        assert inputs.error.endswith(f": {why}")
        inputs.poll(begin + 0.9)
        assert inputs._socket is None
        inputs.poll(time.monotonic() + 1.0)
        assert inputs._socket is not None


@pytest.mark.parametrize(("outputs", "frequency"), [((), 10.0), (("target_speed_fraction",), 125.0)])
def test_a_controller_sends_as_often_as_its_outputs_are_needed(
    outputs: tuple[str, ...], frequency: float
) -> None:
    with connected(outputs) as (inputs, controller):
        poll_until(inputs, lambda: controller.setups() == 1 and len(controller.requests) == 3)
        assert controller.requests[-1] == wire.OutputSetup(frequency, ("timestamp", *outputs))


def test_an_answer_that_was_not_asked_for_is_told_and_ends_the_connection() -> None:
    """Which recipe it is about is not known."""
    with connected() as (inputs, controller):
        controller.answer(*2 * [wire.SetupReply(True, 1, ("INT32",))])
        poll_until(inputs, lambda: bool(inputs.error))
        assert "expected one answer to each setup of inputs, got another" in inputs.error
        assert not inputs.can_write("a")


@pytest.mark.parametrize("host", ["robot.invalid", 64 * "a" + ".invalid"])
def test_a_name_that_cannot_be_resolved_is_told(host: str) -> None:
    inputs = RtdeInputs(host, 30004, {"a": ["input_int_register_47"]})
    poll_until(inputs, lambda: bool(inputs.error))
    assert f"RTDE inputs of the robot at {host}:30004: the name {host} cannot be resolved" in inputs.error


def test_an_address_without_a_way_to_it_is_told_at_once() -> None:
    inputs = RtdeInputs("255.255.255.255", 30004, {"a": ["input_int_register_47"]})
    inputs.poll(time.monotonic())
    assert inputs.error.endswith("255.255.255.255:30004: cannot be reached: Network is unreachable")


def test_a_controller_that_has_moved_is_found_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    address = "127.0.0.2"

    def look_up(*_: Any) -> list[tuple[int, int, int, str, tuple[str, int]]]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (address, 0))]

    with rtde_server() as server:
        monkeypatch.setattr(socket, "getaddrinfo", look_up)
        inputs = RtdeInputs("robot", server.port, {"a": ["input_int_register_47"]})
        poll_until(inputs, lambda: "Connection refused" in inputs.error)
        address = "127.0.0.1"
        poll_until(inputs, lambda: inputs.can_write("a"))
        inputs.close()


def test_a_recipe_that_was_refused_is_asked_for_once_by_the_next_connection() -> None:
    """A second request for the same inputs would find them in use, by ourselves."""
    taken = {"a": ["input_int_register_47"]}
    with rtde_server() as server:
        first, second = (RtdeInputs("127.0.0.1", server.port, taken) for _ in range(2))
        poll_until(first, lambda: first.ready)
        poll_until(second, lambda: bool(second.refused))
        first.close()
    poll_until(second, lambda: bool(second.error))
    assert not second.refused
    with rtde_server(port=server.port):
        poll_until(second, lambda: second.ready)
        deadline = time.monotonic() + 1.5
        poll_until(second, lambda: time.monotonic() > deadline)
        assert second.ready
        assert not second.refused
    second.close()


def test_answers_are_those_of_this_connection() -> None:
    """The one before may have ended before it had all of them."""
    recipes = {"a": ["input_int_register_47"], "b": ["input_double_register_47"]}
    granted = wire.SetupReply(True, 7, ("INT32",)), wire.SetupReply(True, 8, ("DOUBLE",))
    with socket.create_server(("127.0.0.1", 0)) as server:
        inputs = RtdeInputs("127.0.0.1", server.getsockname()[1], recipes)
        inputs.poll(time.monotonic())
        with server.accept()[0] as connection:
            Controller(connection).answer(wire.ProtocolVersionReply(True), granted[0])
            poll_until(inputs, lambda: inputs.can_write("a"))
            connection.sendall(wire.encode(granted[1])[:5])
        poll_until(inputs, lambda: bool(inputs.error))
        inputs.poll(time.monotonic() + 1.1)
        with server.accept()[0] as connection:
            Controller(connection).answer(wire.ProtocolVersionReply(True), *granted)
            poll_until(inputs, lambda: len(inputs._granted) == 2)
            assert {name: recipe.recipe_id for name, recipe in inputs._granted.items()} == {"a": 7, "b": 8}
        inputs.close()
