"""The runner: it starts the pipeline's process, hears from it, and starts it again when it dies."""

import asyncio
import contextlib
import json
import multiprocessing
import os
import signal
from collections.abc import AsyncIterator, Callable

import pytest

from contactsense import Scene
from service.runner import Runner
from service.worker import Source
from tests.service import fakes

SCENE = Scene.model_validate({"robot": "ur5e"})


@contextlib.asynccontextmanager
async def running(
    source: Callable[[Scene], Source],
) -> AsyncIterator[tuple[Runner, list[tuple[float, bytes]]]]:
    heard: list[tuple[float, bytes]] = []
    runner = Runner(SCENE, source, lambda t, message: heard.append((t, message)))
    runner.start()
    try:
        yield runner, heard
    finally:
        await runner.stop()
        assert not multiprocessing.active_children()


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(280):  # kernels may have to be compiled
        while not condition():
            await asyncio.sleep(0.01)


def test_estimates_and_health_come_from_the_process() -> None:
    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            assert runner.status == "starting"
            await until(lambda: len(heard) > 200 and runner.source.rate > 0.0)
            assert runner.status == "ok"
            assert runner.current
            assert runner.pipeline.restarts == 0
            times = [t for t, _ in heard[:200]]
            assert times == sorted(times)
            assert json.loads(heard[199][1])["t"] == times[199]

    asyncio.run(scenario())


def test_a_mute_robot_is_told_of_and_no_reason_to_give_up() -> None:
    async def scenario() -> None:
        async with running(fakes.Mute) as (runner, heard):
            await until(lambda: runner.status == "waiting")
            assert "192.0.2.1:30004 cannot be reached" in runner.message
            assert "trying again" in runner.message
            assert not runner.current
            assert not heard

    asyncio.run(scenario())


def test_a_process_that_dies_is_started_again() -> None:
    async def scenario() -> None:
        async with running(fakes.Crashing) as (runner, heard):
            await until(lambda: runner.status == "failing")
            assert "exit code 3" in runner.message
            assert not runner.current
            before = len(heard)
            await until(lambda: len(heard) > before)
            assert runner.pipeline.restarts == 1

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_is_killed_is_started_again() -> None:
    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            await until(lambda: len(heard) > 10)
            (process,) = multiprocessing.active_children()
            os.kill(process.pid or 0, signal.SIGKILL)
            await until(lambda: runner.status == "failing")
            assert str(-signal.SIGKILL) in runner.message

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_hangs_is_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.runner._SILENCE", 1.0)

    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            await until(lambda: len(heard) > 10)
            (process,) = multiprocessing.active_children()
            os.kill(process.pid or 0, signal.SIGSTOP)
            await until(lambda: runner.status == "failing")
            assert "said nothing for 1 s" in runner.message

    asyncio.run(scenario())


def test_what_breaks_it_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    async def scenario() -> None:
        async with running(fakes.Broken) as (runner, _):
            await until(lambda: runner.status == "failing")
            assert "ValueError: no such field" in runner.message

    asyncio.run(scenario())
    assert "Traceback" in capfd.readouterr().err  # and in full for whoever mends it


def test_nothing_to_run() -> None:
    async def scenario() -> None:
        runner = Runner(SCENE, None, lambda t, message: None)
        runner.start()
        assert runner.status == "idle"
        await runner.stop()

    asyncio.run(scenario())
