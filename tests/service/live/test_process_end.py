"""What the runner does when the pipeline's process ends, hangs or is to be replaced; without a process."""

import asyncio
import json
import multiprocessing
from collections.abc import Awaitable, Callable
from multiprocessing.process import BaseProcess
from types import SimpleNamespace
from typing import Any, cast

import pytest

from contactsense import Scene
from contactsense.service.live import process_exit, supervisor
from contactsense.service.live.health import PipelineHealth, SourceHealth
from contactsense.service.live.pipeline_connection import HEAD, HEALTH, LOADING, REPORT
from contactsense.service.live.silence import ProcessState
from contactsense.service.live.supervisor import Runner
from tests.service import fakes

SCENE = Scene.model_validate({"robot": "ur5e"})


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(60):
        while not condition():
            await asyncio.sleep(0.001)


def watched(
    monkeypatch: pytest.MonkeyPatch,
    run_once: Callable[[Runner, Any], Awaitable[str]],
    scenario: Callable[[Runner], Awaitable[None]],
) -> None:
    """Play a scenario with a runner whose process is `run_once`."""

    async def play() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        monkeypatch.setattr(runner, "_run_once", lambda source: run_once(runner, source))
        runner.start()
        try:
            await scenario(runner)
        finally:
            await runner.stop()

    asyncio.run(play())


def test_a_process_that_fails_again_and_again_is_started_after_longer_and_longer_pauses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(supervisor, "_PAUSE", (0.001, 0.005))
    pauses: list[float] = []
    sleep = asyncio.sleep

    async def noted(delay: float) -> None:
        pauses.append(delay)
        await sleep(delay)

    ends = 0

    async def fails(runner: Runner, source: Any) -> str:
        runner._process = "running"
        runner.pipeline.alive = runner.source.connected = True
        runner.source.rate = 500.0
        return "failed (no such field)"

    async def scenario(runner: Runner) -> None:
        def count() -> None:
            nonlocal ends
            ends += 1

        runner.on_end = count
        with monkeypatch.context() as patch:
            patch.setattr(supervisor.asyncio, "sleep", noted)
            while runner.pipeline.restarts < 5:
                await sleep(0.001)
        assert runner.status == "failing"
        assert "failed (no such field)" in runner.message
        assert not runner.pipeline.alive
        assert (runner.source.connected, runner.source.rate) == (False, 0.0)
        assert runner.loaded.is_set()

    watched(monkeypatch, fails, scenario)
    assert ends >= 5
    assert [pause for pause in pauses if pause < supervisor.TICK][:4] == [0.001, 0.002, 0.004, 0.005]


def test_another_scene_is_taken_at_once_and_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "_PAUSE", (1000.0, 1000.0))
    sources: list[object] = []

    async def run(runner: Runner, source: object) -> str:
        sources.append(source)
        await runner._restart.wait()
        return "was ended for a new scene"

    async def scenario(runner: Runner) -> None:
        await until(lambda: len(sources) == 1)
        runner.restart(SCENE, fakes.Steady)
        await until(lambda: len(sources) == 2)
        assert sources == [fakes.Mute, fakes.Steady]
        assert runner.status == "starting"
        assert runner.pipeline.restarts == 1

    watched(monkeypatch, run, scenario)


def listened(*messages: bytes, restart: bool = False) -> tuple[str, bool]:
    """What a runner makes of a process that sends these messages and then nothing more."""

    async def scenario() -> tuple[str, bool]:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        reader = asyncio.StreamReader()
        reader.feed_data(b"".join(messages))
        if restart:
            runner.restart(SCENE, fakes.Mute)
        async with asyncio.timeout(60):
            return await runner._listen(reader, multiprocessing.current_process())

    return asyncio.run(scenario())


def progress(share: float) -> bytes:
    return message(LOADING, {"share": share, "left": 10.0})


def message(kind: bytes, content: dict[str, Any]) -> bytes:
    payload = json.dumps(content).encode()
    return HEAD.pack(kind, 0.5, len(payload)) + payload


CASES: list[tuple[str, str, tuple[bytes, ...], str]] = [
    ("_FIRST_WORD", "S", (), "was silent for 0.05 s"),
    ("_LOADING_SILENCE", "S", (progress(0.5),), "was silent for 0.05 s"),
    ("_STUCK", "S", (progress(0.5),), "made no progress compiling its kernels for 0.05 s"),
    ("_STOPPED", "T", (), "was stopped, or dead, for 0.05 s"),
]


@pytest.mark.parametrize(("limit", "state", "messages", "reason"), CASES, ids=[case[0] for case in CASES])
def test_a_process_that_hangs_is_to_be_killed(
    monkeypatch: pytest.MonkeyPatch, limit: str, state: str, messages: tuple[bytes, ...], reason: str
) -> None:
    """Each limit by itself; the others are far away."""
    for name in ("_FIRST_WORD", "_LOADING_SILENCE", "_STUCK", "_STOPPED", "_SILENCE"):
        monkeypatch.setattr(supervisor, name, 0.05 if name == limit else 1000.0)
    monkeypatch.setattr(supervisor, "TICK", 0.01)
    monkeypatch.setattr(supervisor, "process_state", lambda pid: ProcessState(state, 0.0))
    assert listened(*messages) == (reason, True)


def test_a_process_that_does_not_end_for_a_new_scene_is_to_be_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "TICK", 0.01)
    monkeypatch.setattr(process_exit, "_PATIENCE", 0.05)
    assert listened(restart=True) == ("was ended for a new scene", True)


@pytest.mark.parametrize("stopped", [False, True])
def test_a_process_that_hangs_before_it_has_read_its_scene_is_killed(
    stopped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene was waited for, so that neither the process nor the service ever ended."""
    monkeypatch.setattr(supervisor, "work", fakes.deaf)
    monkeypatch.setattr(supervisor, "packed", lambda scene: bytes(1 << 24))
    monkeypatch.setattr(supervisor, "_FIRST_WORD", 1000.0 if stopped else 0.05)
    monkeypatch.setattr(process_exit, "_PATIENCE", 0.05)

    async def scenario() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        async with asyncio.timeout(60):
            task = asyncio.create_task(runner._run_once(fakes.Mute))
            if stopped:
                while not multiprocessing.active_children():
                    await asyncio.sleep(0.01)
                await asyncio.sleep(0.1)
                task.cancel()
                await asyncio.wait([task])
            else:
                assert await task == "was silent for 0.05 s"
        assert not multiprocessing.active_children()

    asyncio.run(scenario())


def test_what_a_process_reports_until_it_has_ended_for_a_new_scene_is_taken() -> None:
    """Clips that it completed were said to be lost."""
    health = {"source": SourceHealth().model_dump(), "pipeline": PipelineHealth(alive=True).model_dump()}
    reports: list[dict[str, Any]] = []

    async def scenario() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None, reports.append)
        reader = asyncio.StreamReader()

        def end() -> None:
            for kind, content in ((HEALTH, health), (REPORT, {"type": "clip"})):
                reader.feed_data(message(kind, content))
            reader.feed_eof()

        runner._to_pipeline = cast(asyncio.StreamWriter, SimpleNamespace(write_eof=end))
        runner.restart(SCENE, fakes.Mute)
        process = cast(BaseProcess, SimpleNamespace(pid=None, exitcode=0))
        assert await runner._listen(reader, process) == ("was ended for a new scene", False)
        assert runner.pipeline.alive
        assert runner.status == "starting"
        assert not runner.send({"type": "clip"})

    asyncio.run(scenario())
    assert reports == [{"type": "clip"}]


def test_commands_are_refused_where_no_process_runs() -> None:
    """Whoever sent one would wait for what it does."""
    assert not Runner(SCENE, fakes.Mute, lambda t, message: None).send({"type": "acknowledge"})
