"""WS /v1/track with a real server and a real client."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from contactsense import Sample, Scene
from contactsense.service.api.app import create_app
from contactsense.service.api.messages import EstimateOut
from contactsense.service.api.settings import Settings
from contactsense.service.controllers.settings import ControllerSettings
from contactsense.service.controllers.track_session import TrackSession
from tests.service import fakes, http
from tests.service.serving import serving

SLOW = 250  # a process that loads its kernels on a busy machine


@pytest.fixture(scope="module")
def pushed() -> Sample:
    """What an arm that is pushed at its forearm measures."""
    source = fakes.Steady(Scene(robot="ur5e"))
    source.poll(0.0)  # the samples before the push
    return source.poll(0.0)[0]


@pytest.fixture(scope="module")
def place() -> Iterator[str]:
    with serving(create_app(Settings(controllers=ControllerSettings(tracks=1)))) as place:
        yield place


def message(sample: Sample, t: float) -> dict[str, Any]:
    assert sample.joint_torque is not None
    assert sample.base_wrench is not None
    return {
        "t": t,
        "q": sample.q.tolist(),
        "qd": sample.qd.tolist(),
        "joint_torque": sample.joint_torque.tolist(),
        "base_wrench": sample.base_wrench.tolist(),
    }


@contextmanager
def opened(place: str) -> Iterator[ClientConnection]:
    """A connection; the one before may still be ending its process."""
    deadline = time.monotonic() + 30
    while True:
        with connect(f"ws://{place}/v1/track", compression=None) as client:
            if _is_accepted(client):
                yield client
                return
        assert time.monotonic() < deadline
        time.sleep(0.1)


def _is_accepted(client: ClientConnection) -> bool:
    """Whether it is answered; what is refused beyond the permitted number comes unasked."""
    try:
        (error,) = ask(client, {"t": "now"})["errors"]
    except ConnectionClosed:
        return False
    return error["field"] in ("t", "q")


def ask(client: ClientConnection, content: Any) -> Any:
    client.send(json.dumps(content))
    return json.loads(client.recv(timeout=SLOW))


@pytest.mark.slow
def test_a_stream_in_both_forms(place: str, pushed: Sample) -> None:
    with opened(place) as client:
        refused = ask(client, {**message(pushed, 0.0), "q": [0.0] * 7})
        assert refused == {
            "errors": [{"field": "q", "reason": "expected a list of 6 numbers, one per joint of ur5e, got 7"}]
        }
        answers = [ask(client, message(pushed, 0.002 * i)) for i in range(300)]
        assert [answer["t"] for answer in answers] == [0.002 * i for i in range(300)]
        last = EstimateOut.model_validate(answers[-1])
        assert last.contacts[0].link == "forearm"
        assert last.contacts[0].id == 1
        onset = [event for answer in answers for event in answer["events"] if event["kind"] == "onset"]
        assert [event["contact"] for event in onset] == [1]

        client.send(msgpack.packb(message(pushed, 0.602)))
        packed = client.recv(timeout=SLOW)
        assert isinstance(packed, bytes)
        estimate = EstimateOut.model_validate(msgpack.unpackb(packed))
        assert estimate.contacts[0].id == 1

        late = ask(client, {"scene": {"robot": "ur10e"}})
        assert late["errors"][0]["field"] == "scene"
        with connect(f"ws://{place}/v1/track") as second:
            beyond = json.loads(second.recv(timeout=SLOW))
            assert "at most 1 connections" in beyond["errors"][0]["reason"]
            with pytest.raises(ConnectionClosed) as closed:
                second.recv(timeout=SLOW)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1013


@pytest.mark.slow
def test_a_scene_of_its_own(place: str, pushed: Sample) -> None:
    with opened(place) as client:
        wrong = ask(client, {"scene": {"robot": "ur99"}})
        assert wrong["errors"][0]["field"] == "scene.robot"
        taken = ask(client, {"scene": {"robot": "ur10e", "base_wrench": None}})
        assert taken["robot"] == "ur10e"
        assert len(taken["joints"]) == 6
        assert "no such sensor" in ask(client, message(pushed, 0.0))["errors"][0]["reason"]
        answer = ask(client, {**message(pushed, 0.0), "base_wrench": None})
        EstimateOut.model_validate(answer)


@pytest.mark.slow
def test_no_sample_is_estimated_after_a_refused_scene(pushed: Sample) -> None:
    session = TrackSession(Scene(robot="ur5e"))

    def answer(content: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(session.answer(json.dumps(content).encode(), False))
        return found

    for wrong in ({"robot": "ur10e", "mountign": "ceiling"}, {"robot": "ur10e", "self": 1}, "ur10e"):
        answer({"scene": wrong})
        refused = answer(message(pushed, 0.0))
        assert refused["errors"][0]["field"] == "scene"
        assert "refused" in refused["errors"][0]["reason"]
        assert not session.loaded
    assert answer({"scene": {"robot": "ur10e"}})["robot"] == "ur10e"
    EstimateOut.model_validate(answer(message(pushed, 0.0)))


def test_a_late_sample_is_refused_and_the_stream_goes_on(pushed: Sample) -> None:
    """A clock that is set back further begins a new stream."""
    session = TrackSession(Scene(robot="ur5e"))

    def answer(t: float) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(session.answer(json.dumps(message(pushed, t)).encode(), False))
        return found

    before = [answer(0.002 * i) for i in range(100)][-1]
    late = answer(0.19)
    assert late == {
        "errors": [
            {"field": "t", "reason": "expected a later time than 0.198 of the sample before, got 0.19"}
        ]
    }
    again = answer(0.198)
    assert again == {
        "errors": [
            {"field": "t", "reason": "expected a later time than that of the sample before, got 0.198 again"}
        ]
    }
    after = answer(0.2)
    assert after["contacts"][0]["id"] == before["contacts"][0]["id"]
    assert after["events"] == []
    again = answer(-5.0)
    assert "got an earlier one: a new stream begins" in again["reason"]


def test_a_silent_connection_is_closed() -> None:
    settings = Settings(controllers=ControllerSettings(idle=0.2))
    with (
        serving(create_app(settings)) as place,
        connect(f"ws://{place}/v1/track") as client,
        pytest.raises(ConnectionClosed) as closed,
    ):
        client.recv(timeout=SLOW)
    assert closed.value.rcvd is not None
    assert "nothing has come" in closed.value.rcvd.reason


@pytest.mark.slow
def test_a_controller_is_the_source_of_the_pipeline(pushed: Sample) -> None:
    settings = Settings(controllers=ControllerSettings(source="push"))
    with serving(create_app(settings)) as place:
        health = _until(place, lambda health: "no controller" in health["message"])
        assert health["status"] == "waiting"
        with connect(f"ws://{place}/v1/track", compression=None) as client:
            bad = ask(client, {"t": "now"})
            assert bad["errors"][0]["field"] in ("t", "q")
            answers = [ask(client, message(pushed, 0.002 * i)) for i in range(300)]
            assert [answer["t"] for answer in answers] == [0.002 * i for i in range(300)]
            assert answers[-1]["contacts"][0]["link"] == "forearm"
            client.send(msgpack.packb(message(pushed, 0.6)))
            assert msgpack.unpackb(client.recv(timeout=SLOW))["t"] == 0.6
            assert ask(client, {"scene": {"robot": "ur5e"}})["errors"][0]["field"] == "scene"

            with connect(f"ws://{place}/v1/track") as second:
                assert "another controller" in json.loads(second.recv(timeout=SLOW))["errors"][0]["reason"]
            events = http.get(f"http://{place}/v1/events").json()["events"]
            assert "onset" in [event["kind"] for event in events]
            _until(place, lambda health: "has sent no usable sample" in health["message"])
        _until(place, lambda health: "no controller" in health["message"])


@pytest.fixture(scope="module")
def source(pushed: Sample) -> Iterator[str]:
    """A service whose samples a controller pushes."""
    with serving(create_app(Settings(controllers=ControllerSettings(source="push")))) as place:
        _until(place, lambda health: "no controller" in health["message"])
        yield place


def _steady(client: ClientConnection, sample: Sample, start: float, count: int = 300) -> list[Any]:
    """Answers to `count` samples at 500 Hz from the time `start` on."""
    return [ask(client, message(sample, start + 0.002 * i)) for i in range(count)]


def _events(place: str, since: int) -> list[dict[str, Any]]:
    events: list[dict[str, Any]] = http.get(f"http://{place}/v1/events?since={since}").json()["events"]
    return events


def _reader(place: str) -> ClientConnection:
    """A reader of the stream that takes in all messages, also those that no test asks for: otherwise it would
    not hear the end of the connection."""
    return connect(f"ws://{place}/v1/stream", max_queue=None)


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 0.61, 1.7e9])
def test_another_controller_begins_anew(
    source: str, pushed: Sample, start: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Its clock may be earlier, go on, or be that of a computer: nothing of the last one is left."""
    caplog.set_level("INFO", "contactsense")
    known = [event["id"] for event in _events(source, 0)]
    with _reader(source) as reader, opened(source) as client:
        first = _steady(client, pushed, 0.0)
        reader.recv(timeout=SLOW)
    with _reader(source) as reader, opened(source) as client:
        again = _steady(client, pushed, start)
        seen = json.loads(reader.recv(timeout=SLOW))
    reason = "a controller has connected anew: a new stream begins, in which the observer is settling"
    assert (again[0]["t"], again[0]["status"], again[0]["reason"]) == (start, "degraded", reason)
    assert (seen["t"], seen["reason"]) == (start, reason)
    assert not any("milliseconds" in answer["reason"] for answer in again)
    number = first[-1]["contacts"][0]["id"]
    assert again[-1]["contacts"][0]["id"] == number + 1
    assert again[-1]["contacts"][0]["link"] == "forearm"
    told = [
        (event["kind"], event["contact"], event["reason"])
        for event in _events(source, max(known, default=0))
        if event["kind"] in ("onset", "release") and event["contact"] in (number, number + 1)
    ]
    assert told == [
        ("onset", number, ""),
        ("release", number, f"the end of the contact was not seen: {reason}"),
        ("onset", number + 1, ""),
    ]
    lines = [record.message for record in caplog.records if "sends the samples from now on" in record.message]
    assert lines[-1].startswith("a controller at 127.0.0.1 sends")


@pytest.mark.slow
def test_a_clock_that_is_set_back_or_far_ahead_within_one_controller(source: str, pushed: Sample) -> None:
    """Late samples are refused; a clock that was set goes on, and what was open ends."""
    with opened(source) as client:
        number = _steady(client, pushed, 100.0)[-1]["contacts"][0]["id"]
        late = ask(client, message(pushed, 100.59))
        assert late["errors"][0]["field"] == "t"
        assert "expected a later time than 100.598" in late["errors"][0]["reason"]
        on = ask(client, message(pushed, 100.6))
        assert on["contacts"][0]["id"] == number
        for start, why in ((5.0, "got an earlier one: a new stream begins"), (60.0, "is the time in milli")):
            changed = _steady(client, pushed, start)
            assert why in changed[0]["reason"]
            assert ("release", number) in [
                (event["kind"], event["contact"]) for event in changed[0]["events"]
            ]
            assert why not in changed[1]["reason"]
            number += 1
            assert changed[-1]["contacts"][0]["id"] == number


def _until(place: str, condition: Any) -> dict[str, Any]:
    deadline = time.monotonic() + SLOW
    while True:
        health: dict[str, Any] = http.get(f"http://{place}/v1/health").json()
        if condition(health):
            return health
        assert time.monotonic() < deadline, health
        time.sleep(0.05)
