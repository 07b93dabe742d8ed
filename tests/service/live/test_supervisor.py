"""The runner: it starts the pipeline's process, hears from it, and starts it again when it dies."""

import asyncio
import contextlib
import errno
import json
import logging
import multiprocessing
import os
import signal
import socket
import time
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from contactsense import Scene
from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.service.api.clips import Clips
from contactsense.service.live.health import PipelineHealth, SourceHealth
from contactsense.service.live.pipeline_connection import (
    ESTIMATE,
    HEAD,
    HEALTH,
    LAST_WORDS,
    LOADING,
    REPORT,
)
from contactsense.service.live.pipeline_process import Source
from contactsense.service.live.silence import Silence
from contactsense.service.live.supervisor import Runner
from contactsense.service.recordings.writing.clip_listener import ClipListener, RecordingSettings
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_mute_robot_is_told_of_and_no_reason_to_give_up() -> None:
    async def scenario() -> None:
        async with running(fakes.Mute) as (runner, heard):
            await until(lambda: runner.status == "waiting")
            assert "192.0.2.1:30004 cannot be reached" in runner.message
            assert "retrying" in runner.message
            assert not runner.current
            assert not heard

    asyncio.run(scenario())


@pytest.mark.slow
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
def test_a_restart_with_another_scene_is_no_failure() -> None:
    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            await until(lambda: len(heard) > 10 and runner.status == "ok")
            runner.restart(SCENE, fakes.Steady)
            await until(lambda: runner.status != "ok")
            seen, before = {runner.status}, len(heard)

            def answers_again() -> bool:
                seen.add(runner.status)
                return len(heard) > before and runner.status == "ok"

            await until(answers_again)
            assert "starting" in seen
            assert "failing" not in seen
            assert runner.pipeline.restarts == 1

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_clip_and_a_recording_outlive_a_new_scene(tmp_path: Path) -> None:
    """The clip, which ends early, was listed as failed though its file is there."""

    async def scenario() -> None:
        settings = RecordingSettings(folder=tmp_path)
        listeners = [partial(ClipListener, settings=settings, rate=500.0)]
        runner = Runner(SCENE, fakes.Steady, lambda t, message: None, clips_report, listeners)
        clips.append(Clips(settings, runner.send))
        runner.on_end = clips[0].note_end
        runner.start()
        try:
            await until(lambda: runner.status == "ok")
            assert clips[0].record(True)
            clip = clips[0].order(None, 60.0, "door")
            await until(lambda: clips[0].recording.rows > 0)
            runner.restart(SCENE, fakes.Steady, listeners)
            await until(lambda: runner.pipeline.restarts == 1)
            assert clip is not None
            assert (clip.error, clips[0].recording.on) == ("", True)
            assert (tmp_path / (clip.file or "")).is_file()
            rows = clips[0].recording.rows
            await until(lambda: clips[0].recording.rows > rows)
        finally:
            await runner.stop()

    clips: list[Clips] = []

    def clips_report(report: dict[str, Any]) -> None:
        clips[0].handle_report(report)

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
def test_a_stopped_process_is_told_of_and_replaced() -> None:
    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            await until(lambda: len(heard) > 10 and runner.status == "ok")
            (process,) = multiprocessing.active_children()
            pid = process.pid or 0
            os.kill(pid, signal.SIGSTOP)
            await until(lambda: runner.status == "failing" and "was stopped, or dead," in runner.message)
            await until(lambda: pid not in [child.pid for child in multiprocessing.active_children()])
            assert not runner.current
            await until(lambda: runner.status == "ok")
            assert runner.pipeline.restarts == 1

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_process_that_hangs_is_started_again() -> None:
    async def scenario() -> None:
        async with running(fakes.Hanging) as (runner, heard):
            await until(lambda: len(heard) > 10)
            await until(lambda: runner.status == "failing" and "was silent for 1.5 s" in runner.message)

    asyncio.run(scenario())


@pytest.mark.long
def test_a_service_that_is_starved_itself_kills_no_healthy_process() -> None:
    async def scenario() -> None:
        async with running(fakes.Steady) as (runner, heard):
            await until(lambda: len(heard) > 10 and runner.status == "ok")
            for _ in range(3):
                # The loop stands still, as under a request that takes long.
                time.sleep(4.0)
                await asyncio.sleep(0.3)
            assert runner.pipeline.restarts == 0
            await until(lambda: runner.status == "ok")

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_full_file_table_is_told_and_outlived(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> tuple[socket.socket, socket.socket]:
        raise OSError(errno.EMFILE, "Too many open files")

    async def scenario() -> None:
        with monkeypatch.context() as patch:
            patch.setattr(socket, "socketpair", full)
            runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
            runner.start()
            await until(lambda: runner.status == "failing")
            assert "Too many open files" in runner.message
            assert "LimitNOFILE" in runner.message
        await until(lambda: runner.status == "waiting")
        await runner.stop()

    asyncio.run(scenario())


@pytest.mark.slow
def test_a_watching_task_that_breaks_is_told_and_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        calls = 0

        async def broken(open_source: object) -> str:
            nonlocal calls
            calls += 1
            raise RuntimeError("cannot start new thread")

        with monkeypatch.context() as patch:
            patch.setattr(runner, "_run_once", broken)
            runner.start()
            await until(lambda: calls > 1)
            assert runner.status != "ok"
            assert "cannot start new thread" in runner.message
        await until(lambda: runner.status == "waiting" and "192.0.2.1" in runner.message)
        await runner.stop()

    asyncio.run(scenario())


@pytest.mark.slow
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


def test_nothing_is_logged_before_the_start(caplog: pytest.LogCaptureFixture) -> None:
    """A service that is refused at its start has had no status."""
    caplog.set_level(logging.INFO, "contactsense")
    runner = Runner(SCENE, None, lambda t, message: None)
    assert not caplog.messages
    runner.start()
    assert caplog.messages == ["idle: no robot is configured: only POST /v1/locate and WS /v1/track work"]


def message(kind: bytes, content: object) -> bytes:
    payload = json.dumps(content).encode()
    return HEAD.pack(kind, 0.5, len(payload)) + payload


def received(runner: Runner, *messages: bytes) -> str:
    """Let a runner take the messages of a process, last words at their end; returns how it ended."""

    return asyncio.run(take(runner, *messages))


async def take(runner: Runner, *messages: bytes) -> str:
    reader = asyncio.StreamReader()
    reader.feed_data(b"".join(messages))
    return await runner._receive(reader, multiprocessing.current_process(), Silence(0.0))


@pytest.mark.parametrize("error", [OSError("disk full"), ValueError("no such kind")])
def test_a_message_that_cannot_be_handled_is_told_and_loses_no_other(
    error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    """The process is healthy: no message of it is the reason to start it again."""
    reports: list[dict[str, object]] = []

    def on_report(report: dict[str, object]) -> None:
        if report["type"] == "event":
            raise error
        reports.append(report)

    runner = Runner(SCENE, fakes.Mute, lambda t, message: None, on_report)
    how = received(
        runner,
        message(REPORT, {"type": "event"}),
        message(REPORT, {"type": "stream"}),
        HEAD.pack(LAST_WORDS, 0.0, 4) + b"over",
    )
    assert how == "failed (over)"
    assert reports == [{"type": "stream"}]
    assert runner.message_errors.count == 1
    assert runner.message_errors.last == f"report: {type(error).__name__}: {error}"
    assert f"could not be handled: {runner.message_errors.last}" in caplog.text


def test_a_progress_bar_that_fails_loses_no_message() -> None:
    def broken(progress: CompilationProgress) -> None:
        raise OSError("the terminal is gone")

    heard: list[float] = []
    runner = Runner(SCENE, fakes.Mute, lambda t, message: heard.append(t), on_loading=broken)
    received(
        runner,
        message(LOADING, {"share": 0.5, "left": 10.0}),
        message(ESTIMATE, {"status": "none"}),
        message(ESTIMATE, {"status": "none"}),
        HEAD.pack(LAST_WORDS, 0.0, 4) + b"over",
    )
    assert heard == [0.5, 0.5]
    assert runner.loaded.is_set()
    assert runner.message_errors.count == 2
    assert runner.message_errors.last == "progress: OSError: the terminal is gone"


def test_messages_of_the_next_process_do_not_make_the_latest_sample_look_new() -> None:
    over = HEAD.pack(LAST_WORDS, 0.0, 4) + b"over"
    source = SourceHealth(connected=True, age=0.002).model_dump()
    health = {"source": source, "pipeline": PipelineHealth(alive=True).model_dump()}

    async def scenario() -> None:
        runner = Runner(SCENE, fakes.Mute, lambda t, message: None)
        runner._loop = asyncio.get_running_loop()
        await take(runner, message(HEALTH, health), message(ESTIMATE, {"status": "none"}), over)
        await asyncio.sleep(0.2)
        await take(runner, message(LOADING, {"share": 0.1, "left": 30.0}), over)
        assert runner.report_age is not None
        assert runner.sample_age is not None
        assert runner.report_age < 0.1
        assert runner.sample_age >= 0.2
        source["age"] = None  # the next process has no sample yet
        await take(runner, message(HEALTH, health), over)
        assert runner.sample_age >= 0.2

    asyncio.run(scenario())
