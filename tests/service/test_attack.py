"""The service under attack by half requests, large bodies, floods, idle readers: no sample is lost."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable

import httpx
import pytest
from websockets.sync.client import connect

from contactsense.service.demo.processes import Stage

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(600)]

SECONDS = 8.0


def address(url: str) -> tuple[str, int]:
    host, port = url.removeprefix("http://").split(":")
    return host, int(port)


def half_requests(url: str) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(300):
            with contextlib.suppress(OSError):
                connection = stack.enter_context(socket.create_connection(address(url), 1.0))
                connection.sendall(b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n")
        time.sleep(1.0)


def large_bodies(url: str) -> None:
    with contextlib.suppress(httpx.HTTPError):
        pieces = (b" " * 1_000_000 for _ in range(100))
        httpx.post(f"{url}/v1/locate", content=pieces, timeout=10.0)


def deep_body(url: str) -> None:
    with contextlib.suppress(httpx.HTTPError):
        httpx.post(f"{url}/v1/locate", content=b"[" * 1_000_000, timeout=10.0)


def many_samples(url: str) -> None:
    sample = {"q": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "base_wrench": [5.9, 2.4, -19.0, -1.1, -2.3, -0.6]}
    with contextlib.suppress(httpx.HTTPError):
        httpx.post(f"{url}/v1/locate", content=json.dumps({"samples": [sample] * 2000}), timeout=10.0)


def flood(url: str) -> None:
    with contextlib.suppress(httpx.HTTPError), httpx.Client(base_url=url) as client:
        for _ in range(500):
            client.get("/v1/contacts")


def garbage(url: str) -> None:
    with contextlib.suppress(OSError), socket.create_connection(address(url), 1.0) as connection:
        connection.sendall(b"\x00\xff\r\n" * 10_000)
        connection.recv(100)


def readers_that_take_nothing(url: str) -> None:
    stream = f"ws{url.removeprefix('http')}/v1/stream"
    with contextlib.suppress(Exception), contextlib.ExitStack() as stack:
        for _ in range(10):
            stack.enter_context(connect(stream, max_queue=1, close_timeout=0.1))
        time.sleep(2.0)


ATTACKS: list[Callable[[str], None]] = [
    half_requests,
    large_bodies,
    deep_body,
    many_samples,
    flood,
    garbage,
    readers_that_take_nothing,
]


def test_no_attack_costs_a_sample() -> None:
    with Stage("ur5e") as stage:
        client = stage.start_service()
        stage.start_arm("--loop")
        for _ in range(500):
            client.receive()
        before = client.health()
        over = threading.Event()

        def attack(how: Callable[[str], None]) -> None:
            while not over.is_set():
                how(client.url)

        threads = [threading.Thread(target=attack, args=(how,), daemon=True) for how in ATTACKS]
        for thread in threads:
            thread.start()
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            client.receive()
        over.set()
        for thread in threads:
            thread.join(30.0)
        deadline = time.monotonic() + 20.0
        while time.monotonic() < deadline:  # rates and connections of this address recover
            with contextlib.suppress(Exception):
                after = client.health()
                break
            time.sleep(0.2)
    taken = after.source.robot.received - before.source.robot.received
    assert taken >= 0.9 * 500 * SECONDS
    assert after.source.robot.lost == before.source.robot.lost
    assert after.pipeline.restarts == 0
    assert after.clients.beyond_limits["413"] > 0
    assert after.clients.late + after.clients.refused > 0
