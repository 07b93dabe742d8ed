"""Receivers of webhooks, and a delivery to them."""

import asyncio
import http.server
import re
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from contactsense.service.events.journal import Journal
from contactsense.service.reactions.actions.webhook import WebhookAction
from contactsense.service.reactions.webhook_delivery import WebhookDelivery

SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
DECISION = {"rule": "arm", "level": "collision", "kind": "begin", "link": "forearm", "force": 60.0, "t": 3.5}


class Receiver(http.server.ThreadingHTTPServer):
    """Answers by `statuses` in turn, the last one for ever, and keeps what came."""

    def __init__(self, *statuses: int) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.statuses, self.heard = list(statuses), list[tuple[dict[str, str], bytes]]()


class _Handler(http.server.BaseHTTPRequestHandler):
    server: Receiver

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        headers = {name.lower(): value for name, value in self.headers.items()}
        status = self.server.statuses[0]
        if len(self.server.statuses) > 1:
            self.server.statuses.pop(0)
        self.server.heard.append((headers, body))
        self.send_response(status)
        if status == 307:
            self.send_header("Location", "/elsewhere")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def receiver(*statuses: int) -> Iterator[Receiver]:
    with Receiver(*statuses) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def raw_receiver(answer: bytes) -> Iterator[int]:
    """Sends `answer` to whoever connects, then nothing more until the end; yields its port."""
    with socket.create_server(("127.0.0.1", 0)) as server, ExitStack() as peers:

        def serve() -> None:
            with suppress(OSError):
                while True:
                    peer = peers.enter_context(server.accept()[0])
                    peer.recv(65536)
                    peer.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()


def hook(port: int) -> WebhookAction:
    return WebhookAction(type="webhook", url=f"http://127.0.0.1:{port}/hook", secret=SECRET, timeout=5.0)


def deliver(
    journal: Journal,
    webhook: WebhookAction,
    enqueue: int,
    done: Callable[[WebhookDelivery, list[Any]], bool],
    error: str = "",
) -> list[tuple[bool, str]]:
    """Run a delivery until `done`; what it told. Its error is as the pattern `error`."""
    told: list[tuple[bool, str]] = []

    def tell(_: str, ok: bool, reason: str, decision: Mapping[str, Any]) -> None:
        assert decision == DECISION
        told.append((ok, reason))

    async def scenario() -> None:
        delivery = WebhookDelivery(journal, {"hook": webhook}, tell, (0.0, 0.05, 0.05))
        delivery.start()
        for _ in range(enqueue):
            delivery.enqueue("hook", DECISION)
        async with asyncio.timeout(20):
            while not done(delivery, told):
                await asyncio.sleep(0.01)
        assert re.fullmatch(error, delivery.error)
        await delivery.stop()

    asyncio.run(scenario())
    return told


def waiting(journal: Journal) -> int:
    """Number of deliveries in the outbox."""
    with journal.lock:
        (number,) = journal.database.execute("SELECT count(*) FROM deliveries").fetchone()
    return int(number)


def stored(journal: Journal, count: int) -> None:
    """Put deliveries into the outbox."""
    delivery = WebhookDelivery(journal, {"hook": hook(1)}, lambda *_: None)
    for _ in range(count):
        delivery.enqueue("hook", DECISION)
