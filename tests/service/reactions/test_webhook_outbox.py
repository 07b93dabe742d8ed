"""The outbox of webhooks over months: it is bounded, and due times follow the host's clock."""

import asyncio
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.reactions import webhook_delivery
from contactsense.service.reactions.actions.webhook import WebhookAction
from contactsense.service.reactions.webhook_delivery import WebhookDelivery
from tests.service.reactions.webhook_receivers import DECISION, SECRET, hook, receiver, waiting

HOUR = 3600.0
SetClock = Callable[[float], None]


@pytest.fixture
def set_clock(monkeypatch: pytest.MonkeyPatch) -> SetClock:
    """Sets the host's clock forward, or back, by seconds."""
    real = time.time
    return lambda by: monkeypatch.setattr(time, "time", lambda: real() + by)


def outbox(journal: Journal, told: list[tuple[str, int]] | None = None) -> WebhookDelivery:
    def tell(_: str, ok: bool, reason: str, decision: Mapping[str, Any]) -> None:
        assert told is not None
        assert not ok
        told.append((reason, decision["n"]))

    url = "http://127.0.0.1:1/hook"
    webhooks = {
        name: WebhookAction(type="webhook", url=url, secret=SECRET, timeout=5.0) for name in ("hook", "other")
    }
    return WebhookDelivery(journal, webhooks, tell, (0.0, 5.0, 300.0))


def pauses(journal: Journal) -> list[float]:
    """Time until each delivery is due [s]."""
    rows = journal.database.execute("SELECT due FROM deliveries ORDER BY id").fetchall()
    return [due - time.time() for (due,) in rows]


def test_beyond_its_limit_the_oldest_is_lost_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webhook_delivery, "MOST", 3)
    told: list[tuple[str, int]] = []
    with Journal() as journal:
        delivery = outbox(journal, told)
        delivery.enqueue("other", {**DECISION, "n": -1})
        for n in range(5):
            delivery.enqueue("hook", {**DECISION, "n": n})
            journal.database.execute("UPDATE deliveries SET due = due + 5 WHERE id = 2")  # it has failed
        assert told == [("lost, as 3 later ones wait", n) for n in (0, 1)]
        (count,) = journal.database.execute("SELECT count(*) FROM deliveries").fetchone()
        assert count == 4  # that of the other webhook, too


def test_one_that_is_stored_is_not_lost_though_the_oldest_cannot_be_removed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(webhook_delivery, "MOST", 1)
    told: list[tuple[str, int]] = []
    with Journal() as journal:
        delivery = outbox(journal, told)
        journal.database.execute(
            "CREATE TEMP TRIGGER full BEFORE DELETE ON deliveries BEGIN SELECT RAISE(ABORT, 'full'); END"
        )
        for n in range(2):
            delivery.enqueue("hook", {**DECISION, "n": n})
        assert (told, waiting(journal)) == ([], 2)
        journal.database.execute("DROP TRIGGER full")
        delivery.enqueue("hook", {**DECISION, "n": 2})
        assert told == [("lost, as 1 later ones wait", n) for n in (0, 1)]
        assert waiting(journal) == 1


@pytest.mark.parametrize("added", [0, 1])
@pytest.mark.parametrize("step", [-3.0 * HOUR, 3.0 * HOUR])
def test_pauses_are_the_same_after_the_clock_was_set(step: float, added: int, set_clock: SetClock) -> None:
    """Whether or not a delivery comes before the next look."""
    with Journal() as journal:
        delivery = outbox(journal)
        delivery.enqueue("hook", DECISION)
        delivery._write_result("hook", 1, 2, False, 500)  # due in 300 s
        delivery.enqueue("hook", DECISION)  # due at once
        set_clock(step)
        for _ in range(added):
            delivery.enqueue("hook", DECISION)
        row = delivery._next("hook")
        assert row is not None
        assert row[0] == 2
        first, *others = pauses(journal)
        assert first == pytest.approx(300.0, rel=webhook_delivery.JITTER)
        assert others == [pytest.approx(0.0, abs=1.0)] * (1 + added)


def test_a_clock_that_was_set_back_while_the_service_was_away_delays_nothing_for_long(
    tmp_path: Path, set_clock: SetClock
) -> None:
    settings = JournalSettings(path=tmp_path / "j.db")
    with Journal(settings) as journal:
        outbox(journal).enqueue("hook", DECISION)
    set_clock(-24.0 * HOUR)

    async def scenario(journal: Journal) -> None:
        delivery = outbox(journal)
        delivery.start()
        await delivery.stop()

    with Journal(settings) as journal:
        asyncio.run(scenario(journal))
        (pause,) = pauses(journal)
        assert pause == pytest.approx(2.0 * 300.0 * (1.0 + webhook_delivery.JITTER), abs=10.0)  # the longest


@pytest.mark.parametrize("jitter", [-webhook_delivery.JITTER, webhook_delivery.JITTER])
@pytest.mark.parametrize("overloaded", [429, 502, 504])
def test_a_receiver_that_is_overloaded_gets_twice_the_time(
    overloaded: int, jitter: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each pause is varied, so that retries of many senders do not coincide."""
    monkeypatch.setattr(webhook_delivery.random, "uniform", lambda low, high: low if jitter < 0.0 else high)
    with Journal() as journal:
        delivery = outbox(journal)
        for number, status in ((1, 500), (2, overloaded)):
            delivery.enqueue("hook", DECISION)
            delivery._write_result("hook", number, 2, False, status)
        expected = [300.0 * (1.0 + jitter), 600.0 * (1.0 + jitter)]
        assert pauses(journal) == pytest.approx(expected, abs=10.0)


@pytest.mark.parametrize("step", [-3.0 * HOUR, 3.0 * HOUR])
def test_a_pause_is_the_same_if_the_clock_is_set_during_the_attempt(step: float, set_clock: SetClock) -> None:
    with Journal() as journal:
        delivery = outbox(journal)
        delivery.enqueue("hook", DECISION)
        set_clock(step)
        delivery._write_result("hook", 1, 2, False, 500)
        assert delivery._next("hook") is None
        assert pauses(journal) == [pytest.approx(300.0, rel=webhook_delivery.JITTER)]


@pytest.mark.parametrize(
    ("column", "text", "known"),
    [
        ("body", b'{"data": {"rule"; "arm"}}', {}),
        ("body", b'{"data": {"rule": "\xff"}}', {}),
        ("body", b'{"data": {"rule": "arm"}}', {}),
        ("body", b"7", {}),
        ("webhook_id", b"msg_\xff", DECISION),
        ("webhook_id", b"msg_\n", DECISION),
    ],
)
def test_a_damaged_one_is_told_and_the_next_one_is_delivered(
    column: str, text: bytes, known: Mapping[str, Any]
) -> None:
    """A disk or a memory has changed its text, which SQLite does not notice; no receiver could read it."""
    with receiver(204) as server, Journal() as journal:
        told: list[tuple[bool, str, object]] = []

        async def scenario() -> None:
            webhooks = {"hook": hook(server.server_port)}
            delivery = WebhookDelivery(journal, webhooks, lambda _, *result: told.append(result), (0.0,))
            for _ in range(2):
                delivery.enqueue("hook", DECISION)
            journal.database.execute(
                f"UPDATE deliveries SET {column} = CAST(? AS TEXT), due = 0 WHERE id = 1", (text,)
            )
            delivery.start()
            async with asyncio.timeout(20):
                while len(told) < 2:
                    await asyncio.sleep(0.01)
            assert not delivery.error
            await delivery.stop()

        asyncio.run(scenario())
        assert told == [
            (False, "lost, as its text in the journal is damaged", known),
            (True, "answered 204", DECISION),
        ]
        assert len(server.heard) == 1
        assert waiting(journal) == 0


def test_a_damaged_one_that_is_lost_is_told_without_its_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webhook_delivery, "MOST", 1)
    told: list[object] = []
    with Journal() as journal:
        webhooks = {"hook": hook(1)}
        delivery = WebhookDelivery(journal, webhooks, lambda _, *result: told.append(result))
        delivery.enqueue("hook", DECISION)
        journal.database.execute("UPDATE deliveries SET body = 'x'")
        delivery.enqueue("hook", DECISION)
    assert told == [(False, "lost, as 1 later ones wait", {})]
