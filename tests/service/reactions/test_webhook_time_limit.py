"""Webhooks whose receiver does not answer, or late, or otherwise than expected."""

import asyncio
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.reactions.webhook_delivery import WebhookDelivery
from tests.service.reactions.webhook_receivers import (
    DECISION,
    deliver,
    hook,
    raw_receiver,
    receiver,
    waiting,
)


def test_a_receiver_that_does_not_answer_keeps_nobody_from_ending(tmp_path: Path) -> None:
    """The service ends at once, and the delivery goes on at its next start."""
    journal = Journal(JournalSettings(path=tmp_path / "events.db"))
    with raw_receiver(b"HTTP/1.1 200") as port:
        begin = time.monotonic()
        told = deliver(journal, hook(port), 1, lambda *_: time.monotonic() - begin > 0.3)
        pending = [thread for thread in threading.enumerate() if thread.name == "webhook hook"]
    assert (told, waiting(journal)) == ([], 1)
    assert pending, "the end waited for the attempt"
    assert all(thread.daemon for thread in pending)
    for thread in pending:
        thread.join()
    journal.close()


def test_an_answer_after_the_end_of_the_deliveries_is_none_of_theirs() -> None:
    """An error would be logged, with a traceback."""
    wrong: list[dict[str, Any]] = []
    with socket.create_server(("127.0.0.1", 0)) as server, Journal() as journal:

        async def scenario() -> None:
            asyncio.get_running_loop().set_exception_handler(lambda _, context: wrong.append(context))
            webhooks = {"hook": hook(server.getsockname()[1])}
            delivery = WebhookDelivery(journal, webhooks, lambda *_: None, (0.0,))
            delivery.enqueue("hook", DECISION)
            delivery.start()
            peer, _ = await asyncio.to_thread(server.accept)
            with peer:
                await delivery.stop()
                peer.sendall(b"HTTP/1.1 200 OK\r\n\r\n")
                for thread in threading.enumerate():
                    if thread.name == "webhook hook":
                        await asyncio.to_thread(thread.join)
            await asyncio.sleep(0.0)

        asyncio.run(scenario())
        assert not wrong
        assert waiting(journal) == 1


def test_an_attempt_takes_no_longer_than_its_time_limit() -> None:
    with raw_receiver(b"HTTP/1.1 200") as port, Journal() as journal:
        webhook = hook(port).model_copy(update={"timeout": 0.2})
        ((ok, why),) = deliver(journal, webhook, 1, lambda d, t: len(t) == 1)
    assert not ok
    assert "no answer within 0.2 s" in why


def test_a_resolver_that_hangs_holds_up_no_longer_and_nothing_is_posted_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who was told that an attempt failed does not expect it to arrive after all."""
    answers, look_up = threading.Event(), socket.getaddrinfo

    def hang(host: str, *args: Any) -> Any:
        assert answers.wait(60.0)
        return look_up("127.0.0.1", *args)

    monkeypatch.setattr(socket, "getaddrinfo", hang)
    with receiver(204) as server, Journal() as journal:
        webhook = hook(server.server_port).model_copy(update={"timeout": 0.2})
        ((ok, why),) = deliver(journal, webhook, 1, lambda d, told: len(told) == 1)
        (late,) = [thread for thread in threading.enumerate() if thread.name == "webhook hook"]
        answers.set()
        late.join(20.0)
        assert server.heard == []
    assert not ok
    assert why.startswith(f"{webhook.url}: no answer within 0.2 s")


def test_an_answer_of_others_is_told_in_one_line() -> None:
    """It is written to the log and to terminals."""
    with raw_receiver(b"SSH-2.0 \x1b[31m\xff\r\n") as port:
        (first, *_) = deliver(Journal(), hook(port), 1, lambda _, told: len(told) > 0)
    assert first[1].startswith(f"http://127.0.0.1:{port}/hook: expected HTTP, got SSH-2.0 ?[31m")
    assert first[1].isprintable()
