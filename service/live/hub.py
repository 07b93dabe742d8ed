"""Fan-out: one stream of messages to many readers, none of which can hold up another.

Each reader has a queue of its own, bounded; one that is too slow loses its oldest messages and receives how
many. Lives in one event loop; nothing here locks.
"""

import asyncio
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

_MAX_EVENTS = 1000
"""Events kept for a reader's next message; beyond that the oldest are left to the journal."""
_NO_EVENTS = b'"events":[]}'


def with_events(message: bytes, events: Sequence[bytes]) -> bytes:
    """An estimate's JSON, which ends with an empty list of events, with these in it."""
    if not events or not message.endswith(_NO_EVENTS):
        return message
    return message[:-2] + b",".join(events) + b"]}"


class Reader:
    """One subscriber's queue. A message carries the events since the one before, skipped or lost ones
    included."""

    def __init__(self, size: int, every: int = 1, interval: float = 0.0) -> None:
        """Take one message in `every`, and none sooner than `interval` [s] of sample time after the last."""
        self._queue: deque[tuple[bytes, deque[bytes]]] = deque()
        self._events: deque[bytes] = deque(maxlen=_MAX_EVENTS)
        self._size = size
        self._every = every
        self._interval = interval
        self._count = 0
        self._due = -float("inf")
        self._filled = asyncio.Event()
        self.lost = 0
        """Messages lost since `take_lost`."""
        self.lost_in_all = 0
        """Messages lost ever."""

    def offer(self, t: float, message: bytes, events: Sequence[bytes] = ()) -> None:
        """Put a message into the queue, unless it is to be skipped. `t` is its sample's time [s]; `events`
        are those since the message before."""
        self._events.extend(events)
        self._count += 1
        if (self._count - 1) % self._every:
            return
        if self._interval > 0.0:
            # half a percent early counts as due: time stamps jitter. A clock that jumped back starts afresh.
            if self._due - self._interval <= t < self._due - 0.005 * self._interval:
                return
            late = t - self._due
            self._due = (self._due if 0.0 <= late < self._interval else t) + self._interval
        if len(self._queue) >= self._size:
            _, left = self._queue.popleft()
            following = self._queue[0][1] if self._queue else self._events
            following.extendleft(reversed(left))
            self.lost += 1
            self.lost_in_all += 1
        self._queue.append((message, self._events))
        self._events = deque(maxlen=_MAX_EVENTS)
        self._filled.set()

    async def take(self) -> bytes:
        """The oldest message; waits for one."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        return with_events(*self._queue.popleft())

    def take_lost(self) -> int:
        """How many messages were lost since the last call."""
        lost, self.lost = self.lost, 0
        return lost


class Hub:
    """Passes every message on to all readers and remembers the last."""

    def __init__(self, size: int = 500) -> None:
        """Readers' queues hold `size` messages."""
        self._size = size
        self._readers: set[Reader] = set()
        self._lost_by_gone = 0
        self._events: list[bytes] = []
        self.last: bytes | None = None
        """The latest message."""
        self.last_arrival = -float("inf")
        """When it came, on the host's monotonic clock [s]."""

    @property
    def readers(self) -> int:
        """Number of readers."""
        return len(self._readers)

    @property
    def lost(self) -> int:
        """Messages that readers lost, those gone included."""
        return self._lost_by_gone + sum(reader.lost_in_all for reader in self._readers)

    def add_event(self, event: bytes) -> None:
        """An event as JSON, for the next message."""
        self._events.append(event)

    def publish(self, t: float, message: bytes) -> None:
        """Pass a message on. `t` is its sample's time [s]."""
        events, self._events = self._events, []
        self.last, self.last_arrival = with_events(message, events), time.monotonic()
        for reader in self._readers:
            reader.offer(t, message, events)

    @contextmanager
    def subscribe(self, every: int = 1, interval: float = 0.0) -> Iterator[Reader]:
        """A reader for as long as the context lasts; arguments as for `Reader`."""
        reader = Reader(self._size, every, interval)
        self._readers.add(reader)
        try:
            yield reader
        finally:
            self._readers.discard(reader)
            self._lost_by_gone += reader.lost_in_all
