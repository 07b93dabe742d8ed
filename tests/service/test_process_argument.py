"""Large arguments reach a process over its connection; one that dies before it reads them blocks nobody."""

import asyncio
import multiprocessing
import shutil
import socket
import sys
import threading
from collections.abc import Iterator
from multiprocessing import resource_tracker

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.controllers.track_process import TrackProcess
from contactsense.service.live.locate_process import LocateError, LocateProcess, StaticSample
from contactsense.service.live.supervisor import Runner
from contactsense.service.process_argument import packed, receive
from tests.service import fakes

SCENE = Scene(robot="ur20")
SAMPLE = StaticSample([0.0, -1.3, 1.6, -1.9, -1.57, 0.0], [5.9, 2.4, -19.0, -1.1, -2.3, -0.6], None, None)


def test_an_argument_arrives_whole_and_what_follows_stays() -> None:
    large = np.arange(200_000.0)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        sender = threading.Thread(target=ours.sendall, args=(packed(large) + b"next",))
        sender.start()
        np.testing.assert_array_equal(receive(theirs), large)
        sender.join()
        assert theirs.recv(10) == b"next"


@pytest.mark.parametrize("sent", [0, 4, 100])
def test_the_end_of_the_connection_is_told(sent: int) -> None:
    ours, theirs = socket.socketpair()
    with theirs:
        with ours:
            ours.sendall(packed("x" * 1000)[:sent])
        with pytest.raises(ConnectionResetError):
            receive(theirs)


@pytest.fixture
def dying() -> Iterator[None]:
    """Processes end before they read anything."""
    if shutil.which("false") is None:
        pytest.skip("needs the command false")
    # A pipe holds this much at least; what does not fit in it would block.
    assert len(packed(SCENE)) > 65536
    # It is a Python process as well, and stays.
    resource_tracker.ensure_running()
    multiprocessing.set_executable(shutil.which("false") or "")
    yield
    multiprocessing.set_executable(sys.executable)


@pytest.mark.usefixtures("dying")
@pytest.mark.timeout(60)
def test_a_process_that_locates_and_dies_at_once_is_told_of() -> None:
    async def scenario() -> None:
        process = LocateProcess(SCENE)
        with pytest.raises(LocateError, match="contacts failed"):
            await process.locate([SAMPLE], True)
        process.stop()

    asyncio.run(scenario())


@pytest.mark.usefixtures("dying")
@pytest.mark.timeout(60)
def test_a_process_of_a_controller_that_dies_at_once_ends_its_connection() -> None:
    async def scenario() -> None:
        async with TrackProcess(SCENE) as process:
            with pytest.raises(EOFError):
                await process.channel.receive()

    asyncio.run(scenario())


@pytest.mark.usefixtures("dying")
@pytest.mark.timeout(60)
def test_a_pipeline_that_dies_at_once_is_told_of() -> None:
    async def scenario() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        runner.start()
        try:
            async with asyncio.timeout(30.0):
                while runner.pipeline.restarts == 0:
                    await asyncio.sleep(0.01)
            assert "exit code 1" in runner.message
        finally:
            await runner.stop()

    asyncio.run(scenario())
