"""Webhooks: signed, retried, waiting in the journal over a restart."""

import asyncio
import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.reactions import webhook_delivery
from contactsense.service.reactions.actions.webhook import WebhookAction, decode_secret, sign
from contactsense.service.reactions.webhook_delivery import WebhookDelivery
from tests.service.reactions.webhook_receivers import (
    DECISION,
    SECRET,
    deliver,
    hook,
    receiver,
    waiting,
)


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Retries are soon due here; by default the outbox is looked at once a second."""
    monkeypatch.setattr(webhook_delivery, "_POLL", 0.01)


def test_a_delivery_is_signed_and_has_the_time() -> None:
    begin = datetime.now(UTC)
    with receiver(204) as server, Journal() as journal:
        told = deliver(
            journal, hook(server.server_port), 1, lambda d, t: waiting(journal) == 0 and len(t) == 1
        )
        ((headers, body),) = server.heard
    assert told == [(True, "answered 204")]
    content = json.loads(body)
    assert content["type"] == "collision.begin"
    assert content["data"] == DECISION
    assert begin <= datetime.fromisoformat(content["timestamp"]) <= datetime.now(UTC)
    stamp = int(headers["webhook-timestamp"])
    expected = sign(decode_secret(SECRET), headers["webhook-id"], stamp, body)
    assert headers["webhook-signature"] == expected
    assert headers["content-type"] == "application/json"


def test_it_is_retried_with_the_same_id() -> None:
    with receiver(500, 429, 200) as server, Journal() as journal:
        told = deliver(journal, hook(server.server_port), 1, lambda d, t: len(t) == 3)
        ids = {headers["webhook-id"] for headers, _ in server.heard}
        assert len(ids) == 1
    assert [ok for ok, _ in told] == [False, False, True]
    assert "answered 500: tried again in about 0.05 s" in told[0][1]


def test_each_delivery_has_an_id_of_its_own() -> None:
    with receiver(204) as server, Journal() as journal:
        deliver(journal, hook(server.server_port), 2, lambda d, t: len(t) == 2)
        ids = {headers["webhook-id"] for headers, _ in server.heard}
    assert len(ids) == 2
    assert all(each.startswith("msg_") for each in ids)


def test_a_delivery_is_tried_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not when the outbox is looked at next."""
    monkeypatch.setattr(webhook_delivery, "_POLL", 60.0)
    with receiver(204) as server, Journal() as journal:

        async def scenario() -> None:
            done = asyncio.Event()
            webhooks = {"hook": hook(server.server_port)}
            delivery = WebhookDelivery(journal, webhooks, lambda *_: done.set(), (0.0,))
            delivery.start()
            await asyncio.sleep(0.05)  # now it waits
            delivery.enqueue("hook", DECISION)
            await asyncio.wait_for(done.wait(), 20.0)
            await delivery.stop()

        asyncio.run(scenario())


def test_it_is_given_up_in_the_end_and_a_redirection_is_no_success() -> None:
    with receiver(307) as server, Journal() as journal:
        told = deliver(
            journal, hook(server.server_port), 1, lambda d, t: waiting(journal) == 0 and len(t) == 3
        )
        assert all(not ok for ok, _ in told)
        assert "given up after 3 attempts" in told[-1][1]


def test_gone_disables_also_after_a_restart(tmp_path: Path) -> None:
    settings = JournalSettings(path=tmp_path / "j.db")
    with receiver(410) as server:
        with Journal(settings) as journal:
            told = deliver(
                journal, hook(server.server_port), 2, lambda d, t: bool(d.disabled("hook")) and bool(t)
            )
            assert "disabled until its URL changes" in told[0][1]
            assert waiting(journal) == 1  # not the one that was answered
        with Journal(settings) as journal:
            deliver(journal, hook(server.server_port), 1, lambda d, t: bool(d.disabled("hook")))
        assert len(server.heard) == 1


def test_what_waits_survives_a_restart(tmp_path: Path) -> None:
    settings = JournalSettings(path=tmp_path / "j.db")
    with receiver(200) as server:
        port = server.server_port
    with Journal(settings) as journal:  # nobody there
        told = deliver(journal, hook(port), 1, lambda d, t: len(t) == 1)
        assert not told[0][0]
    with Journal(settings) as journal, receiver(200) as server:
        journal.database.execute("UPDATE deliveries SET due = 0")
        told = deliver(journal, hook(server.server_port), 0, lambda d, t: len(t) == 1)
        assert told == [(True, "answered 200")]
        assert json.loads(server.heard[0][1])["data"] == DECISION


def test_on_a_full_disk_a_webhook_is_told_to_be_lost(tmp_path: Path) -> None:
    told: list[tuple[bool, str]] = []
    with Journal(JournalSettings(path=tmp_path / "j.db")) as journal:
        (pages,) = journal.database.execute("PRAGMA page_count").fetchone()
        journal.database.execute(f"PRAGMA max_page_count = {pages}")
        delivery = WebhookDelivery(
            journal, {"hook": hook(1)}, lambda _, ok, reason, decision: told.append((ok, reason)), (0.0,)
        )
        for _ in range(10):
            delivery.enqueue("hook", {**DECISION, "link": "x" * 2000})
        assert waiting(journal) < 10
    assert (False, "lost, as the journal cannot be written: database or disk is full") in told


def test_on_a_full_disk_nothing_is_posted_twice(tmp_path: Path) -> None:
    told: list[bool] = []
    with receiver(200) as server, Journal(JournalSettings(path=tmp_path / "j.db")) as journal:

        async def scenario() -> None:
            webhooks = {"hook": hook(server.server_port)}
            delivery = WebhookDelivery(
                journal, webhooks, lambda _, ok, reason, decision: told.append(ok), (0.0, 0.0)
            )
            delivery.enqueue("hook", DECISION)
            journal.database.execute("PRAGMA query_only = ON")
            delivery.start()
            async with asyncio.timeout(20):
                while not server.heard:
                    await asyncio.sleep(0.01)
                await asyncio.sleep(0.2)
                assert (len(server.heard), told) == (1, [])
                journal.database.execute("PRAGMA query_only = OFF")
                while not told:
                    await asyncio.sleep(0.01)
            await delivery.stop()

        asyncio.run(scenario())
        assert (len(server.heard), told) == (1, [True])


def test_a_journal_that_cannot_be_read_interrupts_deliveries_and_ends_none(tmp_path: Path) -> None:
    told: list[bool] = []
    with receiver(200) as server, Journal(JournalSettings(path=tmp_path / "j.db")) as journal:

        async def scenario() -> None:
            webhooks = {"hook": hook(server.server_port)}
            delivery = WebhookDelivery(
                journal, webhooks, lambda _, ok, reason, decision: told.append(ok), (0.0,)
            )
            delivery.enqueue("hook", DECISION)
            journal.database.execute("ALTER TABLE disabled RENAME TO away")
            delivery.start()
            async with asyncio.timeout(20):
                while not delivery.error:
                    await asyncio.sleep(0.01)
                assert delivery.error.startswith(
                    "deliveries of webhook hook: OperationalError: no such table"
                )
                journal.database.execute("ALTER TABLE away RENAME TO disabled")
                while not told:
                    await asyncio.sleep(0.01)
            await delivery.stop()

        asyncio.run(scenario())
    assert told == [True]


@pytest.mark.parametrize("url", ["http://127.0.0.1:1/stö\u00dfe", "http://[::1/hook", "http://a..b/hook"])
def test_a_url_that_cannot_be_requested_is_reported_and_stops_nothing(url: str) -> None:
    """It fails as one that nobody answers does, and the deliveries after it have their turn."""
    webhook = WebhookAction(type="webhook", url=url, secret=SECRET, timeout=5.0)
    with Journal() as journal:
        told = deliver(journal, webhook, 2, lambda d, t: waiting(journal) == 0 and len(t) == 6)
    assert not any(ok for ok, _ in told)
    assert all(reason.startswith(f"{url}: ") for _, reason in told)


def test_a_secret_that_cannot_be_read_is_told_and_stops_nothing(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    with receiver(200) as server, Journal() as journal:
        webhook = WebhookAction(type="webhook", url=hook(server.server_port).url, secret_file=file)
        told = deliver(journal, webhook, 1, lambda d, t: len(t) == 3)
        assert [ok for ok, _ in told] == [False] * 3
        assert told[0][1].startswith(f"secret_file: {file}: No such file or directory")
        file.write_text(SECRET)
        assert deliver(journal, webhook, 1, lambda d, t: len(t) == 1) == [(True, "answered 200")]


def test_a_webhook_that_is_gone_is_asked_again_where_its_url_has_changed() -> None:
    with receiver(410) as gone, receiver(410) as gone_too, receiver(200) as new, Journal() as journal:
        for server in (gone, gone_too):
            ((_, why),) = deliver(journal, hook(server.server_port), 1, lambda d, t: len(t) == 1)
            assert "disabled until its URL changes" in why
        told = deliver(journal, hook(new.server_port), 1, lambda d, t: len(t) == 1)
    assert told == [(True, "answered 200")]


def test_other_webhooks_take_the_place_of_those_before() -> None:
    """As after a reload; what waits for one that is gone stays, for rules that have it again."""
    told: list[tuple[str, bool]] = []
    with receiver(200) as first, receiver(200) as second, Journal() as journal:

        async def scenario() -> None:
            before = {"hook": hook(first.server_port), "gone": hook(first.server_port)}
            delivery = WebhookDelivery(
                journal, before, lambda name, ok, reason, decision: told.append((name, ok)), (0.0,)
            )
            delivery.start()
            tasks = len(asyncio.all_tasks())
            await delivery.replace({name: hook(second.server_port) for name in ("hook", "new")})
            assert len(asyncio.all_tasks()) == tasks  # those of before have ended
            for name in ("gone", "hook", "new"):
                delivery.enqueue(name, DECISION)
            async with asyncio.timeout(20):
                while len(told) < 2:
                    await asyncio.sleep(0.01)
            await delivery.stop()

        asyncio.run(scenario())
        assert sorted(told) == [("hook", True), ("new", True)]
        assert (len(first.heard), len(second.heard)) == (0, 2)
        assert waiting(journal) == 1
