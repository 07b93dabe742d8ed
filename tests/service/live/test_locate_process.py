"""Static samples are located elsewhere; that process may die without harm."""

import asyncio
import gc
import os
import signal
import threading
import time
from multiprocessing.context import SpawnProcess
from typing import Any

import pytest

from contactsense import Scene
from contactsense.service.api.messages import EstimateOut
from contactsense.service.live.locate_process import LocateError, LocateProcess, Request, StaticSample
from tests.service.loopback import until

SAMPLE = StaticSample([0.0, -1.3, 1.6, -1.9, -1.57, 0.0], [5.9, 2.4, -19.0, -1.1, -2.3, -0.6], None, None)


@pytest.mark.slow
def test_a_process_that_dies_is_told_of_and_started_again() -> None:
    async def scenario() -> None:
        process = LocateProcess(Scene(robot="ur5e"))
        try:
            (body,) = await process.locate([SAMPLE], True)
            assert EstimateOut.model_validate_json(body).contacts[0].link == "forearm"
            assert process._process is not None
            os.kill(process._process.pid or 0, signal.SIGKILL)
            with pytest.raises(LocateError, match="contacts failed"):
                await process.locate([SAMPLE] * 50, True)
            assert len(await process.locate([SAMPLE], True)) == 1
        finally:
            process.stop()

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_cannot_be_started_is_started_with_the_next_request(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(_: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    async def scenario() -> None:
        process = LocateProcess(Scene(robot="ur5e"))
        opened = len(os.listdir("/proc/self/fd"))
        with monkeypatch.context() as patch:
            patch.setattr(SpawnProcess, "start", refuse)
            for _ in range(3):
                with pytest.raises(LocateError, match="contacts failed"):
                    await process.locate([SAMPLE], True)
        assert len(os.listdir("/proc/self/fd")) == opened
        try:
            assert len(await process.locate([SAMPLE], True)) == 1
        finally:
            process.stop()

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_has_not_read_its_scene_yet_can_be_killed() -> None:
    """The scene of a large arm does not fit into the pipe, and the process needs seconds for its modules."""

    async def scenario() -> None:
        large: Any = bytes(1 << 20)
        process = LocateProcess(large)
        starting = asyncio.create_task(process.start())
        assert await asyncio.to_thread(until, lambda: process._process is not None)
        assert process._process is not None
        os.kill(process._process.pid or 0, signal.SIGSTOP)
        begin = time.monotonic()
        process.restart(Scene(robot="ur5e"))
        assert time.monotonic() - begin < 1.0
        await starting
        try:
            assert len(await process.locate([SAMPLE], True)) == 1
        finally:
            process.stop()

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_does_not_read_a_large_request_holds_up_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ten thousand samples do not fit into the pipe."""

    async def scenario() -> None:
        process = LocateProcess(Scene(robot="ur5e"))
        many = [StaticSample([*SAMPLE.q], [*SAMPLE.q], None, None) for _ in range(10_000)]
        try:
            await process.start()
            assert process._process is not None
            os.kill(process._process.pid or 0, signal.SIGSTOP)
            with monkeypatch.context() as patch:
                patch.setattr("contactsense.service.live.locate_process._FIRST", 0.2)
                with pytest.raises(LocateError, match="no answer in time"):
                    await asyncio.wait_for(process.locate(many, True), 60.0)
            assert len(await process.locate([SAMPLE], True)) == 1
        finally:
            process.stop()

    asyncio.run(scenario())


def test_too_many_requests_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        process = LocateProcess(Scene(robot="ur5e"))
        monkeypatch.setattr("contactsense.service.live.locate_process.MAX_REQUESTS", 0)
        with pytest.raises(LocateError, match="waiting already"):
            await process.locate([SAMPLE], True)

    asyncio.run(scenario())


def test_a_service_that_ends_starts_nothing_any_more() -> None:
    async def scenario() -> None:
        process = LocateProcess(Scene(robot="ur5e"))
        process.stop()
        with pytest.raises(LocateError, match="the service ends"):
            await process.locate([SAMPLE], True)

    asyncio.run(scenario())


def test_a_request_that_is_cancelled_keeps_its_turn_until_it_is_answered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both would wait on one connection, and the second would read the answer of the first."""
    at_once: list[int] = []
    working: list[object] = []
    answered = threading.Event()

    def ask(process: LocateProcess, request: Request) -> list[bytes]:
        samples = request[0]
        working.append(samples)
        at_once.append(len(working))
        answered.wait(10.0)
        working.remove(samples)
        return [b"" for _ in samples]

    async def scenario() -> None:
        monkeypatch.setattr(LocateProcess, "_ask", ask)
        process = LocateProcess(Scene(robot="ur5e"))
        first = asyncio.create_task(process.locate([SAMPLE], True))
        assert await asyncio.to_thread(until, lambda: working)
        first.cancel()
        second = asyncio.create_task(process.locate([SAMPLE] * 2, True))
        await asyncio.sleep(0.05)  # for a second one that would not wait for its turn
        answered.set()
        assert len(await second) == 2
        assert first.cancelled()
        assert process._requests == 0

    asyncio.run(scenario())
    assert at_once == [1, 1]


def test_a_request_that_is_cancelled_and_then_fails_is_no_error_of_the_service(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A client had gone while the process hung, and the log had a traceback."""
    begun, go_on = threading.Event(), threading.Event()
    errors: list[dict[str, Any]] = []

    def ask(process: LocateProcess, request: Request) -> list[bytes]:
        begun.set()
        go_on.wait(10.0)
        raise LocateError("it failed")

    async def scenario() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, error: errors.append(error))
        monkeypatch.setattr(LocateProcess, "_ask", ask)
        process = LocateProcess(Scene(robot="ur5e"))
        first = asyncio.create_task(process.locate([SAMPLE], True))
        assert await asyncio.to_thread(begun.wait, 10.0)
        first.cancel()
        go_on.set()
        while process._requests:
            await asyncio.sleep(0.001)
        with pytest.raises(LocateError, match="it failed"):
            await process.locate([SAMPLE], True)
        del first  # asyncio looks at what is left
        gc.collect()

    asyncio.run(scenario())
    assert errors == []
