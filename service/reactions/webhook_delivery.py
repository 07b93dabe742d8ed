"""Delivers webhooks from the journal's outbox: one task per webhook, retries that survive a restart."""

import asyncio
import contextlib
import json
import random
import re
import sqlite3
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Any

from contactsense.service.events.clock_step import ClockStep
from contactsense.service.events.journal import Journal
from contactsense.service.live.supervision import Supervised
from contactsense.service.reactions.actions.base import ActionError
from contactsense.service.reactions.actions.http_request import request
from contactsense.service.reactions.actions.webhook import WebhookAction, sign
from contactsense.service.reactions.outbox import Outbox

DELAYS = (0.0, 5.0, 300.0, 1800.0, 7200.0, 18000.0, 36000.0, 36000.0)
"""Time before each attempt [s], as Standard Webhooks recommends. After the last attempt the delivery is
dropped."""
JITTER = 0.2
"""Each delay is varied by up to this fraction, so that retries of many senders do not coincide."""
MAX_BODY = 20_000
"""Largest delivery [bytes]; Standard Webhooks recommends less than 20 kB."""
MOST = 1000
"""Deliveries of one webhook that wait; beyond it the oldest are lost. A receiver that is away takes decisions
every few seconds, but an attempt that nobody answers takes as long as its time limit."""
_ID = re.compile(rb"msg_[0-9a-f]{32}")
"""Identifies a delivery, whichever the attempt."""
_THROTTLED = (429, 502, 504)
"""After these statuses the receiver gets twice the time."""
_GRACE = 1.0
"""Time beyond a webhook's time limit after which an attempt is not waited for any more [s]."""
_POLL = 1.0
"""Time between two looks at the outbox [s]."""


class WebhookDelivery:
    """Posts the deliveries that wait in the outbox.

    Args:
        journal: The journal with the outbox.
        webhooks: Name -> webhook.
        on_result: Called with the name, whether an attempt succeeded, what to report, and the decision in the
            form of `Decision.as_dict`; it is empty if it is not known, as the journal is damaged there.
        delays: See `DELAYS`.
    """

    def __init__(
        self,
        journal: Journal,
        webhooks: Mapping[str, WebhookAction],
        on_result: Callable[[str, bool, str, Mapping[str, Any]], None],
        delays: Sequence[float] = DELAYS,
    ) -> None:
        self._journal, self._webhooks, self._on_result = journal, dict(webhooks), on_result
        self._outbox = Outbox(journal)
        self._delays = tuple(delays)
        self._news = {name: asyncio.Event() for name in webhooks}
        self._tasks: list[Supervised] = []
        # Due times are those of the host's clock, as they must survive a restart.
        self._clock_step = ClockStep()

    def start(self) -> None:
        """Start the deliveries."""
        with contextlib.suppress(sqlite3.Error):  # a full disk: what is due meanwhile is delivered
            self._limit_pauses()
        self._tasks = [
            Supervised(f"deliveries of webhook {name}", partial(self._deliver, name))
            for name in self._webhooks
        ]
        for task in self._tasks:
            task.start()

    @property
    def error(self) -> str:
        """Why deliveries are interrupted or may be lost, such as a damaged journal; empty if they are not."""
        interrupted = [f"{task.name}: {task.error}" for task in self._tasks if task.error]
        return "; ".join([*interrupted, *([self._outbox.error] if self._outbox.error else ())])

    async def stop(self) -> None:
        """Stop; waiting deliveries stay in the journal."""
        await asyncio.gather(*(task.stop() for task in self._tasks))

    async def replace(self, webhooks: Mapping[str, WebhookAction]) -> None:
        """Replace the webhooks; deliveries for a removed webhook stay in the journal."""
        await self.stop()
        self._webhooks = dict(webhooks)
        self._news = {name: asyncio.Event() for name in webhooks}
        self.start()

    def enqueue(self, name: str, decision: Mapping[str, Any]) -> None:
        """Put a decision into the outbox; beyond `MOST` that wait, the oldest is lost."""
        body = {
            "type": f"{decision['level']}.{decision['kind']}",
            "timestamp": datetime.now(UTC).isoformat(),
            "data": dict(decision),
        }
        text = json.dumps(body)
        assert len(text) < MAX_BODY
        try:
            with self._journal.lock:
                self._follow_clock()
                self._outbox.run(
                    "deliveries",
                    "INSERT INTO deliveries (action, webhook_id, body, due) VALUES (?, ?, ?, ?)",
                    (name, f"msg_{uuid.uuid4().hex}", text, time.time() + self._delays[0]),
                )
        except sqlite3.Error as error:  # such as a full disk
            reason = f"lost, as the journal cannot be written: {error}"
            self._on_result(name, False, reason, decision)
            return
        for body_lost in self._remove_oldest(name):
            reason = f"lost, as {MOST} later ones wait"
            self._on_result(name, False, reason, _decision_in(body_lost))
        if name in self._news:  # a reload may have removed it
            self._news[name].set()

    def _remove_oldest(self, name: str) -> list[bytes]:
        """Remove a webhook's deliveries beyond `MOST`; returns their bodies. Where the journal cannot be
        written now, they stay until the next one comes."""
        try:
            with self._journal.lock:
                rows = self._outbox.run(
                    "deliveries",
                    "SELECT id, CAST(body AS BLOB) FROM deliveries "
                    "WHERE action = ? ORDER BY id DESC LIMIT -1 OFFSET ?",
                    (name, MOST),
                )
                if rows:
                    self._outbox.run(
                        "deliveries",
                        "DELETE FROM deliveries WHERE action = ? AND id <= ?",
                        (name, rows[0][0]),
                    )
        except sqlite3.Error:
            return []
        return [body for _, body in reversed(rows)]

    def _follow_clock(self) -> None:
        """Move the due times with the host's clock where it was set, as by NTP: a delivery that is due would
        wait for hours. The journal's lock must be held."""
        step = self._clock_step.since_last()
        if step != 0.0:
            self._outbox.run("deliveries", "UPDATE deliveries SET due = due + ?", (step,))

    def _limit_pauses(self) -> None:
        """While the service was away nobody saw how the clock was set: no pause is longer than any can be."""
        longest = 2.0 * max(self._delays) * (1.0 + JITTER)
        self._outbox.run("deliveries", "UPDATE deliveries SET due = min(due, ?)", (time.time() + longest,))

    def disabled(self, name: str) -> str:
        """Why the webhook is disabled; empty if it is not."""
        rows = self._outbox.run(
            "disabled",
            "SELECT CAST(reason AS BLOB) FROM disabled WHERE action = ? AND url = ?",
            (name, self._webhooks[name].url),
        )
        return rows[0][0].decode(errors="replace") if rows else ""

    async def _deliver(self, name: str) -> None:
        while True:
            self._news[name].clear()
            row = None if self.disabled(name) else self._next(name)
            if row is None:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._news[name].wait(), _POLL)
                continue
            number, webhook_id, stored, attempts = row
            decision = _decision_in(stored)
            if not decision or not _ID.fullmatch(webhook_id):
                self._outbox.drop(number)
                self._on_result(name, False, "lost, as its text in the journal is damaged", decision)
                continue
            ok, status, reason = await self._attempt(name, webhook_id.decode(), stored.decode())
            # Where the journal cannot be written, as on a full disk, the delivery must not be repeated.
            while not self._settle(name, number, attempts + 1, ok, status):
                await asyncio.sleep(_POLL)
            self._on_result(name, ok, self._words(reason, ok, status, attempts + 1), decision)

    def _next(self, name: str) -> tuple[int, bytes, bytes, int] | None:
        with self._journal.lock:
            self._follow_clock()
            rows = self._outbox.run(
                "deliveries",
                "SELECT id, CAST(webhook_id AS BLOB), CAST(body AS BLOB), CAST(attempts AS INTEGER) "
                "FROM deliveries WHERE action = ? AND due <= ? ORDER BY due LIMIT 1",
                (name, time.time()),
            )
        return rows[0] if rows else None

    async def _attempt(self, name: str, webhook_id: str, body: str) -> tuple[bool, int, str]:
        """Try to deliver, in a thread of its own: the event loop waits for its usual ones before it ends, and
        the service would end no sooner than a receiver that is slow."""
        loop, webhook = asyncio.get_running_loop(), self._webhooks[name]
        result: asyncio.Future[tuple[bool, int, str]] = loop.create_future()

        def take(found: tuple[bool, int, str]) -> None:
            if not result.done():  # the delivery has been stopped
                result.set_result(found)

        def run() -> None:
            found = self._post(name, webhook_id, body)
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(take, found)

        threading.Thread(target=run, name=f"webhook {name}", daemon=True).start()
        try:
            # Looking up a name takes as long as the computer's resolver wants.
            return await asyncio.wait_for(result, webhook.timeout + _GRACE)
        except TimeoutError:
            return False, 0, f"{webhook.url}: no answer within {webhook.timeout:g} s"

    def _post(self, name: str, webhook_id: str, body: str) -> tuple[bool, int, str]:
        webhook, stamp = self._webhooks[name], int(time.time())
        try:
            key = webhook.key()
        except ActionError as error:
            return False, 0, str(error)
        headers = {
            "Content-Type": "application/json",
            "webhook-id": webhook_id,
            "webhook-timestamp": str(stamp),
            "webhook-signature": sign(key, webhook_id, stamp, body.encode()),
        }
        try:
            status = request(webhook.url, "POST", body.encode(), headers, webhook.timeout)
        except ActionError as error:
            return False, 0, f"{webhook.url}: {error}"
        if 200 <= status < 300:
            return True, status, f"answered {status}"
        return False, status, f"{webhook.url} answered {status}"

    def _settle(self, name: str, number: int, attempts: int, ok: bool, status: int) -> bool:
        """Write down the result of an attempt; returns False if the journal cannot be written now."""
        try:
            with self._journal.lock:
                self._write_result(name, number, attempts, ok, status)
        except sqlite3.Error:  # the journal reports it
            return False
        return True

    def _write_result(self, name: str, number: int, attempts: int, ok: bool, status: int) -> None:
        self._follow_clock()
        if status == 410:
            self._outbox.run(
                "disabled",
                "INSERT OR REPLACE INTO disabled VALUES (?, ?, ?)",
                (name, self._webhooks[name].url, "it answered 410 Gone"),
            )
        if ok or attempts >= len(self._delays) or status == 410:
            self._outbox.drop(number)
            return
        pause = self._delays[attempts] * random.uniform(1.0 - JITTER, 1.0 + JITTER)
        if status in _THROTTLED:
            pause *= 2.0
        self._outbox.run(
            "deliveries",
            "UPDATE deliveries SET attempts = ?, due = ? WHERE id = ?",
            (attempts, time.time() + pause, number),
        )

    def _words(self, reason: str, ok: bool, status: int, attempts: int) -> str:
        if ok:
            return reason
        if status == 410:
            return f"{reason}: disabled until its URL changes"
        if attempts >= len(self._delays):
            return f"{reason}: given up after {attempts} attempts"
        return f"{reason}: tried again in about {self._delays[attempts]:g} s"


def _decision_in(stored: bytes) -> dict[str, Any]:
    """The decision of a delivery in the outbox; empty if a disk or a memory has changed its text: SQLite does
    not notice it."""
    try:
        decision: dict[str, Any] = json.loads(stored.decode())["data"]
        kinds = {"rule": str, "link": str, "t": int | float}
        return decision if all(isinstance(decision[name], kind) for name, kind in kinds.items()) else {}
    except (ValueError, TypeError, LookupError):
        return {}
