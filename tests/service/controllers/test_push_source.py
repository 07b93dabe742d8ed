"""Samples that a controller pushes, as the pipeline's process receives them."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from contactsense import Scene
from contactsense.service.controllers import push_source
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.push_source import PushSource

SCENE = Scene.model_validate({"robot": "ur5e", "base_wrench": None})
GOOD = {"t": 1.0, "q": [0.0] * 6, "qd": [0.0] * 6, "joint_torque": [1.0] * 6}


@pytest.fixture
def source(tmp_path: Path) -> Iterator[PushSource]:
    made = PushSource(SCENE, tmp_path / "push")
    try:
        yield made
    finally:
        made.close()


def connected(tmp_path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(str(tmp_path / "push"))
    return connection


def test_a_controller_that_hangs_up_after_a_bad_message_ends_nothing(
    source: PushSource, tmp_path: Path
) -> None:
    with connected(tmp_path) as first:
        source.poll(0.0)
        first.sendall(frame(b"{}", False) + frame(b"{}", False))
    assert source.poll(0.2) == []
    assert source.health.unusable == 2
    with connected(tmp_path) as second:
        source.poll(0.0)
        second.sendall(frame(json.dumps(GOOD).encode(), False))
        (sample,) = source.poll(1.0)
        assert sample.t == 1.0


def test_a_controller_is_not_silent_before_it_has_connected(source: PushSource, tmp_path: Path) -> None:
    """Its silence counts from then on, and health tells that it is another one."""
    for connection, error in (
        (1, "no controller is connected to WS /v1/track"),
        (2, "a controller has connected anew (connection 2); the estimation began anew"),
    ):
        with connected(tmp_path):
            source.poll(0.0)
            robot = source.health.robot
            assert (robot.state, robot.connections, robot.error) == ("streaming", connection, error)
        source.poll(0.2)


def sent(*messages: dict[str, object]) -> bytes:
    return b"".join(frame(json.dumps(message).encode(), False) for message in messages)


def test_why_messages_are_refused_is_told(
    source: PushSource, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The controller may not read the answers, and whoever asks for health does not see them."""
    monkeypatch.setattr(push_source, "_SILENT", 0.0)
    with connected(tmp_path) as controller:
        source.poll(0.0)
        controller.sendall(sent(*({**GOOD, "q": [0.0] * 5},) * 2))
        source.poll(0.1)
        assert "refused" not in source.health.trouble  # one or two happen
        controller.sendall(sent(*({**GOOD, "q": [0.0] * 5},) * 5))
        source.poll(0.1)
        assert source.health.trouble == (
            "the controller at WS /v1/track has sent no usable sample for 0 s; the controller's messages "
            "are refused, the latest one because of q: expected a list of 6 numbers, one per joint of ur5e, "
            "got 5"
        )


def test_times_in_the_wrong_order_are_told(source: PushSource, tmp_path: Path) -> None:
    def swapped(count: int) -> bytes:
        return sent(*({**GOOD, "t": 0.002 * (i ^ 1)} for i in range(count)))

    with connected(tmp_path) as controller:
        source.poll(0.0)
        controller.sendall(sent(GOOD, {**GOOD, "t": 0.5}))
        source.poll(0.1)
        assert source.health.trouble == ""  # the controller was started again
        controller.sendall(swapped(10))
        source.poll(0.1)
        assert source.health.trouble.startswith("t: the times of the samples run back again and again")


def test_a_late_sample_is_refused_and_the_stream_goes_on(source: PushSource, tmp_path: Path) -> None:
    """As with a robot's packets in the wrong order: one of them must not begin the estimation anew."""
    with connected(tmp_path) as controller:
        source.poll(0.0)
        controller.sendall(sent(*({**GOOD, "t": t} for t in (1.0, 1.004, 1.002, 1.006))))
        assert [sample.t for sample in source.poll(1.0)] == [1.0, 1.004, 1.006]
        controller.settimeout(5.0)
        ((answer, _),) = Unframer().feed(controller.recv(1 << 16))
        assert json.loads(answer) == {
            "errors": [
                {"field": "t", "reason": "expected a later time than 1.004 of the sample before, got 1.002"}
            ]
        }
        assert source.health.trouble == ""


@pytest.mark.parametrize(("back", "refused"), [(0.2, 10), (0.5, 0), (100.0, 0)])
def test_a_clock_that_is_set_back_is_followed(
    source: PushSource, tmp_path: Path, back: float, refused: int
) -> None:
    with connected(tmp_path) as controller:
        source.poll(0.0)
        controller.sendall(sent(GOOD, *({**GOOD, "t": 1.0 - back + 0.002 * i} for i in range(20))))
        times = [sample.t for sample in source.poll(1.0)]
        assert times == [1.0, *(1.0 - back + 0.002 * i for i in range(refused, 20))]
        assert source.streams == 1


def test_what_a_controller_has_sent_comes_before_the_next_one(source: PushSource, tmp_path: Path) -> None:
    assert source.streams == 0
    with connected(tmp_path) as first:
        source.poll(0.0)
        first.sendall(sent(GOOD, {**GOOD, "t": 2.0}))
    with connected(tmp_path) as second:
        second.sendall(sent({**GOOD, "t": 7.0}))
        assert [sample.t for sample in source.poll(1.0)] == [1.0, 2.0]
        assert source.streams == 1
        assert [sample.t for sample in source.poll(1.0)] == [7.0]
        assert source.streams == 2
        assert source.health.robot.state == "streaming"
        assert source.health.robot.error == (
            "a controller has connected anew (connection 2); the estimation began anew"
        )


def test_another_controller_is_not_compared_with_the_last_one(source: PushSource, tmp_path: Path) -> None:
    moving = [{**GOOD, "t": 0.002 * i, "q": [0.001 * i] * 6, "qd": [0.5] * 6} for i in range(400)]
    with connected(tmp_path) as first:
        source.poll(0.0)
        first.sendall(sent(*({**each, "qd": [-0.5] * 6} for each in moving)))
        while source.health.unusable == 0:
            source.poll(0.1)
        assert "qd: the joint velocities are not those" in source.health.trouble
    while source.poll(0.1):
        pass
    with connected(tmp_path) as second:
        source.poll(0.0)
        second.sendall(sent(moving[0]))
        assert len(source.poll(1.0)) == 1
        assert source.health.trouble == ""


def test_another_controller_is_not_blamed_for_the_messages_of_the_last_one(
    source: PushSource, tmp_path: Path
) -> None:
    with connected(tmp_path) as first:
        source.poll(0.0)
        first.sendall(sent(*({**GOOD, "q": [0.0] * 5},) * 5))
        source.poll(0.1)
        assert "refused" in source.health.trouble
    while source.health.robot.error.startswith("the controller"):
        source.poll(0.1)
    with connected(tmp_path) as second:
        source.poll(0.0)
        second.sendall(sent(GOOD))
        assert len(source.poll(1.0)) == 1
        assert source.health.trouble == ""


def test_the_connection_of_the_last_controller_is_closed_where_another_one_takes_its_place(
    source: PushSource, tmp_path: Path
) -> None:
    """As where the service has lost it: otherwise it would be listened to for ever."""
    with connected(tmp_path) as first:
        source.poll(0.0)
        with connected(tmp_path) as second:
            source.poll(0.0)
            first.settimeout(5.0)
            assert first.recv(1) == b""
            second.sendall(sent(GOOD))
            (sample,) = source.poll(5.0)
            assert sample.t == 1.0
            assert source.health.robot.state == "streaming"
            assert source.health.without_wrench == 0  # the scene has no base sensor
