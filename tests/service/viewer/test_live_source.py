"""The live source: it draws what a service sends, and tells what it cannot use."""

import asyncio
import errno
import http.client
import socket
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from fastapi import FastAPI, WebSocket
from fastapi.responses import PlainTextResponse

from contactsense.scene import Scene
from contactsense.service.live.estimate_json import estimate_json
from contactsense.service.reactions.health import LatchOut, ReactionsOut
from contactsense.service.viewer import live_source
from contactsense.service.viewer.live_source import OUTDATED, RATE, LiveSource
from contactsense.service.viewer.service_calls import AwayError, LiveError, ServiceCalls
from contactsense.types import Estimate
from tests.service.loopback import peer, until
from tests.service.serving import serving
from tests.service.viewer.estimates import POSTURE, contact, estimate

SCENE = Scene(robot="ur5e")
PUSH = estimate(SCENE, contact(SCENE, POSTURE, 3, np.array([-0.2, 0.05, 0.0])), t=4.0)


@contextmanager
def service(
    *sent: Estimate,
    scenes: Sequence[Scene] = (SCENE,),
    delay: float = 0.0,
    closed: float = np.inf,
    listener: socket.socket | None = None,
) -> Iterator[tuple[str, list[int]]]:
    """A service that sends estimates to each connection after a delay and then closes it; yields its URL, and
    the connections so far. Its scene is the last of `scenes`. It closes only the first `closed` connections
    of itself. Its socket is made for it, unless it is given one."""
    app, connections = FastAPI(), [0]

    @app.get("/v1/scene")
    def _() -> dict[str, object]:
        scene = scenes[-1]
        dumped = scene.model_dump(mode="json")
        return {"links": scene.link_names, "gravity_base": scene.gravity_base.tolist(), "scene": dumped}

    @app.websocket("/v1/stream")
    async def _(stream: WebSocket) -> None:
        assert float(stream.query_params["rate"]) == RATE
        connections[0] += 1
        await stream.accept()
        await asyncio.sleep(delay)
        for each in sent:
            await stream.send_text(estimate_json(each, POSTURE).decode())
        if connections[0] > closed:
            await stream.receive()
        else:
            await stream.close()

    with serving(app, listener) as address:
        yield f"http://{address}", connections


def test_it_shows_what_the_service_sends_and_comes_back_after_a_loss() -> None:
    with service(PUSH) as (url, connections):
        source = LiveSource(ServiceCalls(url))
        try:
            assert source.scene.model_dump() == SCENE.model_dump()
            assert until(lambda: source.frame().estimate is not None)
            frame = source.frame()
            assert frame.estimate is not None
            assert frame.q is not None
            np.testing.assert_array_equal(frame.q, POSTURE)
            np.testing.assert_array_equal(frame.estimate.contacts[0].point, PUSH.contacts[0].point)
            np.testing.assert_allclose(frame.forces.force[-1], [20.0, 0.0, 0.0])
            assert until(lambda: connections[0] >= 3)
        finally:
            source.close()


def test_a_service_that_has_ended_is_told_without_python() -> None:
    with service(PUSH) as (url, _):
        source = LiveSource(ServiceCalls(url))
        assert until(lambda: source.frame().estimate is not None)
    try:
        assert until(lambda: "the service cannot be heard, trying again: Connection refused" in source.note())
        assert until(lambda: source.frame().estimate is None)
    finally:
        source.close()


def test_it_ends_though_the_service_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C took as long as the time limits of requests."""
    asked, answers = threading.Event(), threading.Event()

    def health(_: ServiceCalls) -> None:
        asked.set()
        assert answers.wait(60.0)
        raise LiveError("late")

    monkeypatch.setattr(ServiceCalls, "health", health)
    with service(PUSH) as (url, _):
        source = LiveSource(ServiceCalls(url))
        assert asked.wait(30.0)
        source.close()
        assert not answers.is_set()
        assert any(thread.is_alive() for thread in source._threads)
        answers.set()
        source.close()


def test_estimates_of_another_arm_are_refused() -> None:
    foreign = Estimate(0.0, "none", (), np.zeros(4), np.zeros(6), np.eye(6))
    with service(foreign) as (url, _):
        source = LiveSource(ServiceCalls(url))
        try:
            assert until(lambda: "it now serves another arm" in source.note())
            assert source.frame().estimate is None
        finally:
            source.close()


def test_a_service_whose_messages_are_refused_is_asked_ever_less_often() -> None:
    foreign = Estimate(0.0, "none", (), np.zeros(4), np.zeros(6), np.eye(6))
    with service(foreign, delay=0.02) as (url, connections):
        begin = time.monotonic()
        source = LiveSource(ServiceCalls(url))
        try:
            assert until(lambda: "it now serves another arm" in source.note())
            # The reason stays while the stream is opened again.
            assert not until(lambda: "it now serves another arm" not in source.note(), timeout=0.4)
            assert until(lambda: connections[0] == 4)
            assert time.monotonic() - begin >= 0.7  # pauses of 0.1, 0.2 and 0.4 s
        finally:
            source.close()


def test_a_service_that_is_back_but_has_nothing_to_send_is_heard() -> None:
    with service(closed=2) as (url, connections):
        source = LiveSource(ServiceCalls(url))
        try:
            assert until(lambda: "cannot be heard" in source.note())
            assert until(lambda: connections[0] == 3 and "cannot be heard" not in source.note())
        finally:
            source.close()


def test_another_scene_of_the_service_is_told() -> None:
    """The arms of UR have the same number of links: their estimates would be drawn on the wrong one."""
    scenes = [SCENE]
    with service(PUSH, scenes=scenes) as (url, connections):
        source = LiveSource(ServiceCalls(url))
        try:
            assert until(lambda: connections[0] >= 1)
            assert OUTDATED not in source.note()
            scenes.append(Scene(robot="ur10e"))
            assert until(lambda: OUTDATED in source.note())
            scenes.append(SCENE)
            assert until(lambda: OUTDATED not in source.note())
        finally:
            source.close()


def test_latched_collisions_go_with_the_reactions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A service that was started again without rules has nothing to acknowledge."""
    reactions = ReactionsOut(status="ok", latched=[LatchOut(rule="stop", t=4.0, link="forearm", force=50.0)])
    health = SimpleNamespace(status="ok", message="all is well", reasons=["all is well"], reactions=reactions)
    monkeypatch.setattr(ServiceCalls, "health", lambda _: health)
    monkeypatch.setattr(ServiceCalls, "reactions", lambda _: reactions)
    monkeypatch.setattr(live_source, "POLL", 0.01)
    with service() as (url, _):
        source = LiveSource(ServiceCalls(url))
        try:
            assert until(lambda: [latch.rule for latch in source.latches] == ["stop"])
            reactions.status = "off"
            assert until(lambda: not source.latches, timeout=5.0)
        finally:
            source.close()


@pytest.mark.parametrize(
    "url",
    [
        "",
        "localhost:8000",
        "ftp://127.0.0.1",
        "http://",
        "http://x:port",
        "http://x/a b",
        "http://x?a=1",
        "http://x#a",
    ],
)
def test_what_is_no_url_is_told(url: str) -> None:
    with pytest.raises(LiveError, match="--url: expected one such as"):
        ServiceCalls(url)


def test_a_service_that_is_not_there_is_told() -> None:
    with pytest.raises(LiveError, match=r"http://127\.0\.0\.1:9 cannot be reached: "):
        ServiceCalls("http://127.0.0.1:9").scene()


def test_another_kind_of_server_is_told() -> None:
    app = FastAPI()
    app.get("/v1/scene")(lambda: {"something": "else"})
    app.get("/v1/recording")(lambda: {"something": "else"})
    app.get("/text/v1/scene")(lambda: PlainTextResponse("hello"))
    with serving(app) as address:
        for path, call in (
            ("", ServiceCalls.scene),
            ("", ServiceCalls.health),  # 404
            ("", ServiceCalls.recording),
            ("/text", ServiceCalls.scene),
        ):
            with pytest.raises(LiveError, match="this is not a contactsense service"):
                call(ServiceCalls(f"http://{address}{path}"))


def test_a_proxy_whose_service_does_not_answer_is_told() -> None:
    """It was said to be no contactsense service."""
    app = FastAPI()
    app.get("/v1/scene")(lambda: PlainTextResponse("nothing there", 502))
    with serving(app) as address, pytest.raises(AwayError) as caught:
        ServiceCalls(f"http://{address}").scene()
    assert str(caught.value) == f"http://{address}/v1/scene: 502 Bad Gateway"


@pytest.mark.parametrize("answers", [(), (b"( -1.000000 )\n",)])
def test_a_server_without_http_is_told(answers: tuple[bytes, ...]) -> None:
    """A service that serves TLS hangs up; ports of robot programs and of the robot answer."""
    told = "does not speak HTTP" if answers else "if it serves TLS"
    with peer(*answers, hang_up=True) as port, pytest.raises(LiveError, match=told):
        ServiceCalls(f"http://127.0.0.1:{port}").scene()


def test_a_service_without_tls_is_told() -> None:
    with service() as (url, _), pytest.raises(LiveError, match="does not serve TLS"):
        ServiceCalls(url.replace("http", "https")).scene()


@pytest.mark.parametrize(
    ("error", "kind", "told"),
    [
        (
            ssl.SSLCertVerificationError(1, "certificate verify failed"),
            LiveError,
            "SSL_CERT_FILE names a file",
        ),
        (
            http.client.RemoteDisconnected("no answer"),
            LiveError,
            "no answer; if it serves TLS, the URL begins with https",
        ),
        (socket.gaierror(socket.EAI_NONAME, "unknown"), LiveError, "cannot be reached: unknown"),
        (ConnectionRefusedError(111, "Connection refused"), AwayError, "reached: Connection refused"),
        (TimeoutError("timed out"), AwayError, "cannot be reached: timed out"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), AwayError, "cannot be reached: No route to host"),
    ],
    ids=lambda each: getattr(each, "__name__", type(each).__name__),
)
def test_what_to_do_is_told_where_a_service_cannot_be_reached(
    error: OSError, kind: type[LiveError], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only a service that may still come is away."""

    def fail(*_: object, **__: object) -> None:
        raise urllib.error.URLError(error)

    if isinstance(error, ssl.SSLCertVerificationError):
        error.verify_message = "self-signed certificate"
    monkeypatch.setattr(urllib.request, "urlopen", fail)
    with pytest.raises(LiveError) as caught:
        ServiceCalls("http://127.0.0.1:9").scene()
    assert caught.type is kind
    assert told in str(caught.value)
    assert "Errno" not in str(caught.value)
