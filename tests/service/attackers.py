"""Attacks on the service, each in a process of its own."""

import contextlib
import json
import multiprocessing
import os
import socket
import time
from collections.abc import Callable, Iterator

import httpx
from websockets.sync.client import connect

from tests.service import http


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
        http.post(f"{url}/v1/locate", content=pieces, timeout=10.0)


def deep_body(url: str) -> None:
    with contextlib.suppress(httpx.HTTPError):
        http.post(f"{url}/v1/locate", content=b"[" * 1_000_000, timeout=10.0)


def many_samples(url: str) -> None:
    sample = {"q": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "base_wrench": [5.9, 2.4, -19.0, -1.1, -2.3, -0.6]}
    with contextlib.suppress(httpx.HTTPError):
        http.post(f"{url}/v1/locate", content=json.dumps({"samples": [sample] * 2000}), timeout=10.0)


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


def repeat(number: int, url: str) -> None:
    """One of the attacks, again and again, until this process is killed."""
    os.nice(5)  # attackers are other machines: they should not take the mock's processor
    while True:
        ATTACKS[number](url)


@contextlib.contextmanager
def attacked(url: str) -> Iterator[None]:
    """All attacks at once, for the length of a `with` block."""
    spawn = multiprocessing.get_context("spawn")
    processes = [spawn.Process(target=repeat, args=(i, url), daemon=True) for i in range(len(ATTACKS))]
    for process in processes:
        process.start()
    try:
        yield
        assert all(process.is_alive() for process in processes)
    finally:
        for process in processes:
            process.kill()
            process.join()
