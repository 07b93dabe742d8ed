"""The process of a controller's connection ends with it, whatever is still on its way."""

import asyncio
import contextlib
import time

import pytest

from contactsense import Scene
from contactsense.service.controllers.track_process import TrackProcess


@pytest.mark.slow
@pytest.mark.timeout(100)
def test_a_controller_that_hangs_up_before_it_has_read_its_answers_frees_its_place() -> None:
    """The process waited for its answers to be read, and the service for it to read what had been sent: four
    such controllers, and no other could connect until the service ended."""

    async def scenario() -> float:
        async with TrackProcess(Scene(robot="ur5e")) as process:
            await process.channel.send(b"{}", False)
            await process.channel.receive()  # it has started
            with contextlib.suppress(TimeoutError):
                while True:  # until both sides wait
                    async with asyncio.timeout(2.0):
                        await process.channel.send(b"{}", False)
            begin = time.monotonic()
        return time.monotonic() - begin

    assert asyncio.run(asyncio.wait_for(scenario(), 60.0)) < 30.0
