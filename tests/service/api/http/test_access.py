"""Closed doors: token, Host, Origin, sizes, times, rates, connections."""

import contextlib
import json
import logging
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
import uvicorn
from fastapi import FastAPI
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from contactsense.service.api.app import create_app
from contactsense.service.api.http.connections import ConnectionLimits, http_protocol, websocket_protocol
from contactsense.service.api.settings import Settings, SettingsError
from tests.service import fakes, http
from tests.service.loopback import until

TOKEN = "a token of more than sixteen characters"


@contextmanager
def guarded(app: FastAPI, **limits: float) -> Iterator[str]:
    """A server with limits on its connections; yields `127.0.0.1:port`."""
    chosen: ConnectionLimits = app.state.service.connections
    for name, value in limits.items():
        setattr(chosen, name, value)
    listener = socket.create_server(("127.0.0.1", 0))
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384)
    config = uvicorn.Config(
        app, http=http_protocol(chosen), ws=websocket_protocol(chosen), log_level="error", lifespan="off"
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        assert until(lambda: server.started)
        yield f"127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def app(**settings: object) -> FastAPI:
    return create_app(Settings.checked(settings), fakes.Mute if settings.pop("robot_host", None) else None)


@pytest.mark.parametrize(
    ("setting", "value", "example"),
    [
        ("allowed_origins", "panel.example", "https://panel.example"),
        ("allowed_origins", "https://panel.example/page", "https://panel.example"),
        ("allowed_origins", "https://a.example,*", "https://panel.example"),
        ("allowed_hosts", "panel.example:8000", "panel.example"),
        ("allowed_hosts", "http://panel.example", "panel.example"),
        ("allowed_hosts", "*", "panel.example"),
        ("allowed_hosts", "robot..cell", "panel.example"),
        ("allowed_origins", "https://panel.example:port", "https://panel.example"),
        ("allowed_origins", "https://panel.example#page", "https://panel.example"),
        ("allowed_origins", "https://me@panel.example", "https://panel.example"),
    ],
)
def test_what_no_request_can_have_is_refused(setting: str, value: str, example: str) -> None:
    with pytest.raises(SettingsError, match=f"{setting}: expected .* such as {example}, got "):
        Settings.checked({setting: value})


def test_an_origin_is_what_browsers_send() -> None:
    given = Settings.checked({"allowed_origins": "https://Panel.example/, http://10.0.0.2:3000"})
    assert given.allowed_origins == ("https://panel.example", "http://10.0.0.2:3000")
    given = Settings.checked(
        {"allowed_origins": "https://a.example:443,http://[::1]:80,http://a.example:443"}
    )
    assert given.allowed_origins == ("https://a.example", "http://[::1]", "http://a.example:443")
    given = Settings.checked({"allowed_origins": "https://Zellenrübe.example", "allowed_hosts": "Rübe"})
    assert given.allowed_origins == ("https://xn--zellenrbe-w9a.example",)
    assert given.allowed_hosts == ("xn--rbe-hoa",)
    assert Settings.checked({"allowed_origins": "", "allowed_hosts": ""}).allowed_hosts == ()


@pytest.fixture(scope="module")
def locked() -> Iterator[str]:
    with guarded(app(token=TOKEN, allowed_hosts="robot.cell", allowed_origins="https://panel.cell")) as place:
        yield place


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"Authorization": "Bearer wrong"}, 401),
        ({"Authorization": f"Basic {TOKEN}"}, 401),
        ({"Authorization": f"Bearer {TOKEN}"}, 200),
        ({"Authorization": f"bearer {TOKEN}"}, 200),
        ({"Authorization": f"Bearer {TOKEN}", "Host": "robot.cell:8000"}, 200),
        ({"Authorization": f"Bearer {TOKEN}", "Host": "evil.example"}, 400),
        ({"Authorization": f"Bearer {TOKEN}", "Host": "[half"}, 400),
        ({"Authorization": f"Bearer {TOKEN}", "Origin": "https://evil.example"}, 403),
        ({"Authorization": f"Bearer {TOKEN}", "Origin": "null"}, 403),
        ({"Authorization": f"Bearer {TOKEN}", "Origin": "https://panel.cell"}, 200),
    ],
)
def test_who_may_ask(locked: str, headers: dict[str, str], status: int) -> None:
    answer = http.get(f"http://{locked}/v1/health", headers=headers)
    assert answer.status_code == status
    if status == 401:
        assert answer.headers["www-authenticate"] == "Bearer"
    if status != 200:
        (error,) = answer.json()["errors"]
        assert error["reason"]


def test_a_page_of_the_service_itself_is_no_stranger(locked: str) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}", "Origin": f"http://{locked}"}
    assert http.get(f"http://{locked}/v1/robot", headers=headers).status_code == 200


@pytest.mark.parametrize("path", ["/v1/ready", "/docs", "/openapi.json", "/docs/assets/swagger-ui.css"])
def test_what_needs_no_token(locked: str, path: str) -> None:
    assert http.get(f"http://{locked}{path}").status_code == 200


def test_the_description_needs_no_internet(locked: str) -> None:
    page = http.get(f"http://{locked}/docs").text
    assert "//cdn" not in page
    assert "/docs/assets/swagger-ui-bundle.js" in page
    assert "/v1/stream" in http.get(f"http://{locked}/openapi.json").json()["info"]["description"]


def test_a_websocket_brings_its_token_as_it_can(locked: str) -> None:
    place = f"ws://{locked}/v1/stream"
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    with connect(place, additional_headers=bearer, close_timeout=0.2):
        pass
    with connect(f"{place}?token={TOKEN.replace(' ', '%20')}", close_timeout=0.2):
        pass
    plain = "one-token-without-blanks"
    with (
        guarded(app(token=plain)) as other,
        connect(
            f"ws://{other}/v1/stream",
            subprotocols=[Subprotocol("contactsense"), Subprotocol(f"bearer.{plain}")],
            close_timeout=0.2,
        ) as stream,
    ):
        assert stream.subprotocol == "contactsense"


@pytest.mark.parametrize(
    ("headers", "status"),
    [({}, 401), ({"Authorization": f"Bearer {TOKEN}", "Origin": "https://evil.example"}, 403)],
)
def test_a_websocket_that_may_not_come_in(locked: str, headers: dict[str, str], status: int) -> None:
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(f"ws://{locked}/v1/stream", additional_headers=headers),
    ):
        pass
    assert refused.value.response.status_code == status


def test_a_websocket_that_is_refused_is_no_error_of_the_service(locked: str) -> None:
    told: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = told.append  # type: ignore[method-assign]
    log = logging.getLogger("uvicorn.error")
    log.addHandler(handler)
    try:
        for path in ("stream", "nothing"):
            with pytest.raises(InvalidStatus), connect(f"ws://{locked}/v1/{path}"):
                pass
        assert http.get(f"http://{locked}/v1/ready").status_code == 200  # by now it has been logged
    finally:
        log.removeHandler(handler)
    assert [record.getMessage() for record in told if record.levelno >= logging.WARNING] == []


def test_a_method_that_is_not_allowed_names_those_that_are(locked: str) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}"}
    answer = http.put(f"http://{locked}/v1/locate", headers=headers)
    assert (answer.status_code, answer.headers["allow"]) == (405, "POST")


def test_the_root_leads_to_the_description_without_a_token(locked: str) -> None:
    answer = http.get(f"http://{locked}/")
    assert (answer.status_code, answer.headers["location"]) == (307, "docs")


def test_a_body_too_large_is_refused_before_it_is_read() -> None:
    with guarded(app(max_body=1000)) as place:
        large = b" " * 300_000
        answer = http.post(f"http://{place}/v1/locate", content=large)
        assert answer.status_code == 413
        assert "at most 1000 bytes" in answer.json()["errors"][0]["reason"]
        pieces = (large[:10_000] for _ in range(30))
        assert http.post(f"http://{place}/v1/locate", content=pieces).status_code == 413
        health = http.get(f"http://{place}/v1/health").json()
        assert health["clients"]["beyond_limits"]["413"] == 2


def answer_to(place: str, request: bytes) -> bytes:
    """What comes back until the other side closes."""
    host, port = place.split(":")
    with socket.create_connection((host, int(port)), 10.0) as connection:
        connection.sendall(request)
        received = b""
        while chunk := connection.recv(4096):
            received += chunk
    return received


def test_half_requests_lock_nobody_out() -> None:
    with guarded(app(), connections=5, head_time=0.5) as place:
        host, port = place.split(":")
        half = [socket.create_connection((host, int(port))) for _ in range(4)]
        for connection in half:
            connection.sendall(b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n")
        assert http.get(f"http://{place}/v1/health").status_code == 200
        late = [connection.recv(4096) for connection in half]
        for connection in half:
            connection.close()
        assert all(answer.startswith(b"HTTP/1.1 408") for answer in late)
        assert http.get(f"http://{place}/v1/health").json()["clients"]["late"] == 4


def test_too_many_half_requests_and_idle_connections_give_way() -> None:
    service = app()
    with guarded(service, connections=6, head_time=30.0) as place, contextlib.ExitStack() as stack:
        host, port = place.split(":")
        counts = service.state.service.connections
        idle = stack.enter_context(httpx.Client(base_url=f"http://{place}", timeout=http.PATIENCE))
        assert idle.get("/v1/ready").status_code == 200
        for _ in range(30):
            half = stack.enter_context(socket.create_connection((host, int(port))))
            half.sendall(b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n")
        assert http.get(f"http://{place}/v1/health").status_code == 200
        # The idle connection and all half requests but those that there is place for.
        assert until(lambda: counts.late >= 26 and counts.opened <= 6)
        assert counts.refused == 0


def test_too_many_connections_are_refused() -> None:
    service = app()
    with guarded(service, connections=3) as place:
        with contextlib.ExitStack() as stack:
            for _ in range(3):
                stack.enter_context(connect(f"ws://{place}/v1/stream"))
            assert until(lambda: service.state.service.connections.opened == 3)
            request = b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n\r\n"
            assert answer_to(place, request).startswith(b"HTTP/1.1 503")
        assert until(lambda: http.get(f"http://{place}/v1/health").status_code == 200)
        assert http.get(f"http://{place}/v1/health").json()["clients"]["refused"] >= 1


def test_a_head_too_large_is_refused() -> None:
    with guarded(app(), head_size=2000) as place:
        received = answer_to(place, b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 3000)
    assert received.startswith(b"HTTP/1.1 431")


@pytest.mark.parametrize("upgrade", ["", "Connection: Upgrade\r\nUpgrade: websocket\r\n"])
def test_a_head_too_large_is_refused_also_if_it_comes_at_once(upgrade: str) -> None:
    head = f"GET /v1/stream HTTP/1.1\r\nHost: localhost\r\n{upgrade}X: ".encode()
    service = app()
    with guarded(service, head_size=2000) as place:
        # Two of them in one piece: only the first is answered, as the connection ends.
        received = answer_to(place, 2 * (head + b"a" * 2000 + b"\r\n\r\n"))
        assert received.count(b"HTTP/1.1") == 1
        assert received.startswith(b"HTTP/1.1 431")
        assert b"larger than 2000 bytes" in received
        assert answer_to(place, head + b"a" * 1500 + b"\r\n\r\n").startswith(b"HTTP/1.1 4")
        assert service.state.service.connections.late == 1


def test_what_is_no_http_is_refused_in_the_form_of_all_errors() -> None:
    with guarded(app()) as place:
        received = answer_to(place, b"\x16\x03\x01\r\n\r\n")
    head, body = received.split(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400")
    assert b"application/json" in head
    assert json.loads(body)["errors"][0]["reason"] == "expected a request of HTTP/1.1, got other bytes"


def test_a_body_that_does_not_arrive_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    service = app()
    object.__setattr__(service.state.service.limits, "body_time", 0.3)
    with guarded(service) as place:
        received = answer_to(
            place, b"POST /v1/locate HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n{"
        )
    assert received.startswith(b"HTTP/1.1 408")


def test_too_many_requests_are_refused() -> None:
    with (
        guarded(app(max_request_rate=1.0)) as place,
        httpx.Client(base_url=f"http://{place}", timeout=http.PATIENCE) as client,
    ):
        answers = [client.get("/v1/robot") for _ in range(30)]
    statuses = {answer.status_code for answer in answers}
    assert statuses == {200, 429}
    refused = next(answer for answer in answers if answer.status_code == 429)
    assert refused.headers["retry-after"] == "1"


def test_a_reader_that_takes_nothing_is_dropped() -> None:
    service = app()
    with guarded(service, reader_time=0.5) as place:
        host, port = place.split(":")
        narrow = socket.socket()
        narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        narrow.connect((host, int(port)))
        # Compressed, such messages would take ten seconds to fill the buffers.
        with connect(
            f"ws://{place}/v1/stream", sock=narrow, max_queue=1, close_timeout=0.2, compression=None
        ):
            hub = service.state.service.hub
            assert until(lambda: hub.readers == 1)
            feeding = True

            def feed() -> None:
                count = 0
                while feeding:
                    hub.publish(0.002 * count, b"x" * 100_000)
                    count += 1
                    threading.Event().wait(0.01)

            thread = threading.Thread(target=feed)
            thread.start()
            try:
                assert until(lambda: hub.readers == 0, 30.0)
            finally:
                feeding = False
                thread.join()
            assert service.state.service.connections.dropped == 1


def test_tls(tmp_path: Path) -> None:
    certificate, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    made = subprocess.run(
        [
            *(
                "openssl",
                "req",
                "-x509",
                "-newkey",
                "rsa:2048",
                "-nodes",
                "-days",
                "2",
                "-subj",
                "/CN=localhost",
            ),
            *("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)),
        ],
        check=False,
        capture_output=True,
    )
    if made.returncode != 0:
        pytest.skip("openssl is not at hand, or too old")
    service = app()
    limits = service.state.service.connections
    with socket.create_server(("127.0.0.1", 0)) as listener:
        config = uvicorn.Config(
            service,
            http=http_protocol(limits),
            ws=websocket_protocol(limits),
            log_level="error",
            lifespan="off",
            ssl_certfile=certificate,
            ssl_keyfile=key,
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, args=([listener],))
        thread.start()
        try:
            assert until(lambda: server.started)
            trusted = ssl.create_default_context(cafile=str(certificate))
            place = f"https://127.0.0.1:{listener.getsockname()[1]}/v1/health"
            assert (
                json.loads(httpx.get(place, verify=trusted, timeout=http.PATIENCE).text)["status"] == "idle"
            )
        finally:
            server.should_exit = True
            thread.join()
