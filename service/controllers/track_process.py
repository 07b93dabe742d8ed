"""The service's side of a controller's process, which is started and ended with its connection."""

import asyncio
import contextlib
import multiprocessing
import socket
from collections import deque
from typing import Self

from contactsense.scene import Scene
from contactsense.service.controllers.framing import Unframer, frame
from contactsense.service.controllers.track_session import work
from contactsense.service.process_argument import packed

_PATIENCE = 2.0
"""Time that the process has to end by itself [s]."""
_CHUNK = 1 << 16


class MessageChannel:
    """Messages over a stream socket in both directions."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._unframer = Unframer()
        self._arrived: deque[tuple[bytes, bool]] = deque()

    async def send(self, message: bytes, binary: bool) -> None:
        """Send a message; waits while the other side reads nothing.

        Raises:
            OSError: The other side has closed the connection.
        """
        self._writer.write(frame(message, binary))
        await self._writer.drain()

    async def receive(self) -> tuple[bytes, bool]:
        """Return the next message, and whether it is MessagePack.

        Raises:
            EOFError: The other side has closed the connection.
        """
        while not self._arrived:
            try:
                chunk = await self._reader.read(_CHUNK)
            except OSError:
                chunk = b""
            if not chunk:
                raise EOFError
            self._arrived.extend(self._unframer.feed(chunk))
        return self._arrived.popleft()

    def abort(self) -> None:
        """Close the socket without waiting for the other side to read what has been sent."""
        self._writer.transport.abort()

    async def close(self) -> None:
        """Close the socket when the other side has read what has been sent."""
        self._writer.close()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()


class TrackProcess:
    """A process with its own localizer, which runs during an `async with` block."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.channel: MessageChannel
        """Connection to the process, in both directions."""

    async def __aenter__(self) -> Self:
        ours, theirs = socket.socketpair()
        self._process = multiprocessing.get_context("spawn").Process(
            target=work, args=(theirs,), name="contactsense track", daemon=True
        )
        with theirs:
            try:
                await asyncio.to_thread(self._process.start)
            except BaseException:
                ours.close()
                raise
        reader, writer = await asyncio.open_connection(sock=ours)
        writer.write(packed(self._scene))
        self.channel = MessageChannel(reader, writer)
        return self

    async def __aexit__(self, *_: object) -> None:
        # The process ends when its connection is closed. It may be waiting itself, for a controller that has
        # hung up before it had read all of its answers, and reads nothing meanwhile.
        self.channel.abort()
        await asyncio.to_thread(self._end)

    def _end(self) -> None:
        self._process.join(0.1)
        if self._process.is_alive():  # it may be loading its kernels
            self._process.terminate()
            self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()
