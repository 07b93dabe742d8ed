"""Fan-out: distributes one stream of messages to many readers, none of which can delay another.

Each reader has its own bounded queue. A reader that is too slow loses its oldest messages and is sent the
number of lost ones. All of this runs in one event loop, without locks.
"""

import asyncio
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

_MAX_EVENTS = 1000
"""Maximum number of events kept for the next message, and for each reader's. Beyond it the oldest are
dropped; the journal still has them."""
_NO_EVENTS = b'"events":[]}'


def with_events(message: bytes, events: Sequence[bytes]) -> bytes:
    """Insert events into the JSON of an estimate, which ends with an empty list of events."""
    if not events or not message.endswith(_NO_EVENTS):
        return message
    return message[:-2] + b",".join(events) + b"]}"


class Reader:
    """The queue of one subscriber. A message carries all events since the previous delivered message,
    including those of skipped or lost messages."""

    def __init__(self, size: int, every: int = 1, interval: float = 0.0) -> None:
        """Accept one of every `every` messages, at least `interval` [s] of sample time apart."""
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
        """Messages lost since the reader subscribed."""

    def offer(self, t: float, message: bytes, events: Sequence[bytes] = ()) -> None:
        """Put a message into the queue, unless it is to be skipped. `t` is the time of its sample [s];
        `events` are the events since the previous message."""
        self._events.extend(events)
        self._count += 1
        if (self._count - 1) % self._every:
            return
        if self._interval > 0.0:
            # Half a percent early counts as due: time stamps jitter. A clock that jumps back starts anew.
            if self._due - self._interval <= t < self._due - 0.005 * self._interval:
                return
            late = t - self._due
            self._due = (self._due if 0.0 <= late < self._interval else t) + self._interval
        if len(self._queue) >= self._size:
            _, left = self._queue.popleft()
            if left:
                following = self._queue[0][1] if self._queue else self._events
                events_since = (*left, *following)
                following.clear()
                following.extend(events_since)  # `extendleft` would drop the newest of too many
            self.lost += 1
            self.lost_in_all += 1
        self._queue.append((message, self._events))
        self._events = deque(maxlen=_MAX_EVENTS)
        self._filled.set()

    def clear(self) -> None:
        """Forget the messages and events that wait."""
        self._queue.clear()
        self._events.clear()

    async def take(self) -> bytes:
        """Return the oldest message; waits until there is one."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        return with_events(*self._queue.popleft())

    def take_lost(self) -> int:
        """Number of messages lost since the last call."""
        lost, self.lost = self.lost, 0
        return lost


class Hub:
    """Passes every message on to all readers and stores the latest."""

    def __init__(self, size: int = 500) -> None:
        """Readers' queues hold `size` messages."""
        self._size = size
        self._readers: set[Reader] = set()
        self._lost_by_gone = 0
        # Without a robot there are no messages, but events, such as those of webhooks.
        self._events: deque[bytes] = deque(maxlen=_MAX_EVENTS)
        self.last: bytes | None = None
        """The latest message."""
        self.last_arrival = -float("inf")
        """Arrival time of the latest message on the host's monotonic clock [s]."""

    @property
    def readers(self) -> int:
        """Number of readers."""
        return len(self._readers)

    @property
    def lost(self) -> int:
        """Messages lost by all readers, including those that have unsubscribed."""
        return self._lost_by_gone + sum(reader.lost_in_all for reader in self._readers)

    def add_event(self, event: bytes) -> None:
        """Add an event, as JSON, to the next message."""
        self._events.append(event)

    def publish(self, t: float, message: bytes) -> None:
        """Pass a message on to all readers. `t` is the time of its sample [s]."""
        events = tuple(self._events)
        self._events.clear()
        self.last, self.last_arrival = with_events(message, events), time.monotonic()
        for reader in self._readers:
            reader.offer(t, message, events)

    @contextmanager
    def subscribe(self, every: int = 1, interval: float = 0.0) -> Iterator[Reader]:
        """A reader that is subscribed while the context is open; arguments as for `Reader`."""
        reader = Reader(self._size, every, interval)
        self._readers.add(reader)
        try:
            yield reader
        finally:
            self._readers.discard(reader)
            self._lost_by_gone += reader.lost_in_all
