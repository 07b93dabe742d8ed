"""Pages of the viewer without a browser: what they receive is counted, or never read."""

import asyncio
import contextlib
import multiprocessing
from collections.abc import AsyncIterator, Iterator
from multiprocessing.connection import Connection

import msgspec.msgpack
import viser
import zstandard
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from contactsense.service.viewer.arm_nodes import link_node

NODE = link_node(1)
"""Node of a link that moves in every frame."""
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 1.0, 1.0], "fov": 1.0,
    "near": 0.01, "far": 100.0, "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
"""A browser's first message."""
_SPAWN = multiprocessing.get_context("spawn")
_START = 60.0


class Pages:
    """Open pages of a viewer."""

    def __init__(self, control: Connection) -> None:
        self._control = control

    def frames(self) -> list[int]:
        """Frames with a new pose of the arm that each page received since the last call.

        Raises:
            RuntimeError: A page was closed, or the scene has not arrived for too long.
        """
        with contextlib.suppress(EOFError, OSError):
            self._control.send("frames")
            if self._control.poll(_START):
                found: list[int] = self._control.recv()
                return found
        raise RuntimeError("the viewer has closed a page, or does not send")


@contextlib.contextmanager
def pages(url: str, readers: int, hanging: int = 0) -> Iterator[Pages]:
    """Open pages of a viewer, in a process of their own; those that read have received the arm.

    Args:
        url: Of the viewer.
        readers: Number of pages that read what they are sent.
        hanging: Number of pages that never read.
    """
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=_run, args=(theirs, url, readers, hanging), daemon=True)
    process.start()
    theirs.close()
    try:
        found = Pages(ours)
        found.frames()
        yield found
    finally:
        ours.close()
        process.join(5.0)
        if process.is_alive():
            process.kill()
            process.join()


def orientations(window: bytes) -> list[list[float]]:
    """Orientations (w, x, y, z) that a window of the viewer's messages gives `NODE`."""
    size = int.from_bytes(window[8:16], "little")
    content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(window[16 : 16 + size]))
    return [
        message["wxyz"]
        for message in content["messages"]
        if message["type"] == "SetOrientationMessage" and message["name"] == NODE
    ]


def _run(control: Connection, url: str, readers: int, hanging: int) -> None:
    asyncio.run(_serve(control, url, readers, hanging))


async def _serve(control: Connection, url: str, readers: int, hanging: int) -> None:
    counts = [0] * readers
    counting: list[asyncio.Task[None]] = []
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(hanging):
            await stack.enter_async_context(_page(url))
        reading = [await stack.enter_async_context(_page(url)) for _ in range(readers)]
        async with asyncio.TaskGroup() as tasks:
            for i, page in enumerate(reading):
                while not orientations(await _window(page)):
                    pass
                counting.append(tasks.create_task(_count(page, counts, i)))
            with contextlib.suppress(EOFError):
                while True:
                    await asyncio.to_thread(control.recv)
                    control.send(list(counts))
                    counts[:] = [0] * readers
            for task in counting:
                task.cancel()


async def _count(page: ClientConnection, counts: list[int], number: int) -> None:
    while True:
        counts[number] += len(orientations(await _window(page)))


async def _window(page: ClientConnection) -> bytes:
    window = await page.recv()
    assert isinstance(window, bytes)
    return window


@contextlib.asynccontextmanager
async def _page(url: str) -> AsyncIterator[ClientConnection]:
    async with connect(
        url.replace("http", "ws", 1),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None, max_queue=1, compression=None, close_timeout=0.2,
    ) as page:  # fmt: skip
        await page.send(msgspec.msgpack.encode(CAMERA))
        yield page
