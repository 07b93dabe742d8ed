"""Tasks that must not end: a task that ends, for whatever reason, is reported and restarted."""

import asyncio
import logging
from collections.abc import Awaitable, Callable

log = logging.getLogger("contactsense")

PAUSE = 0.5
"""Time before a task that ended is restarted [s]."""
LONGEST_PAUSE = 5.0
"""The same at most, as it doubles for a task that ends again and again [s]."""


class Supervised:
    """A task that is restarted whenever it ends.

    Args:
        name: What the task does, for messages.
        body: Creates the coroutine.
    """

    def __init__(self, name: str, body: Callable[[], Awaitable[None]]) -> None:
        self.name = name
        """What the task does."""
        self._body = body
        self._task: asyncio.Task[None] | None = None
        self._stopping = False
        self._pause = PAUSE
        self.failures = 0
        """How often the task has ended."""
        self.error = ""
        """Why it ended the last time; cleared when it has run without failure for a while."""

    def start(self) -> None:
        """Start the task in the running event loop."""
        self._stopping = False
        self._task = asyncio.get_running_loop().create_task(self._run(), name=self.name)
        self._task.add_done_callback(self._ended)

    async def stop(self) -> None:
        """Stop the task for good."""
        self._stopping = True
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task])
            self._task = None

    async def _run(self) -> None:
        while True:
            well = asyncio.get_running_loop().call_later(10.0 * PAUSE, self._is_well)
            try:
                await self._body()
                found = "it ended"
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
            finally:
                well.cancel()
            self.failures += 1
            if found != self.error:  # the same would be logged again and again
                log.error("%s: %s; it is being restarted", self.name, found)
            self.error = found
            await asyncio.sleep(self._pause)
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)

    def _is_well(self) -> None:
        self.error, self._pause = "", PAUSE

    def _ended(self, task: asyncio.Task[None]) -> None:
        # Cancelled from outside, or failed in a way that _run could not catch.
        if not self._stopping and not task.get_loop().is_closed():
            self.failures += 1
            task.get_loop().call_later(PAUSE, self._start_again)

    def _start_again(self) -> None:
        if not self._stopping:
            self.start()
