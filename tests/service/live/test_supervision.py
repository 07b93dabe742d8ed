"""Tasks that must not end."""

import asyncio

import pytest

from contactsense.service.live import supervision
from contactsense.service.live.supervision import Supervised


@pytest.mark.parametrize("how", ["raises", "returns", "is cancelled"])
def test_a_task_that_ends_is_told_of_and_started_again(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervision, "PAUSE", 0.01)
    lives, told = 0, ""

    async def body() -> None:
        nonlocal lives, told
        lives += 1
        if lives >= 3:
            told = task.error  # which is cleared after a while
            await asyncio.sleep(60.0)
        if how == "raises":
            raise OSError("too many open files")
        if how == "is cancelled":
            raise asyncio.CancelledError

    task = Supervised("the watch", body)

    async def scenario() -> None:
        task.start()
        async with asyncio.timeout(10.0):
            while lives < 3:
                await asyncio.sleep(0.01)
        assert task.failures == 2
        if how == "raises":
            assert "too many open files" in told
        await task.stop()
        await asyncio.sleep(0.05)
        assert lives == 3  # stopped for good

    asyncio.run(scenario())


def test_an_error_that_comes_again_is_logged_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It remains the task's error. Another one is logged, and so is the same after the task has been well."""
    monkeypatch.setattr(supervision, "PAUSE", 0.001)
    found = iter(["a", "a", "a", "b", "b", "well", "b"])
    errors = []

    async def body() -> None:
        errors.append(task.error)
        what = next(found, "")
        if not what:
            await asyncio.sleep(60.0)
        if what == "well":
            async with asyncio.timeout(10.0):
                while task.error:
                    await asyncio.sleep(0.001)
            what = next(found)
        raise OSError(what)

    task = Supervised("the watch", body)

    async def scenario() -> None:
        task.start()
        async with asyncio.timeout(10.0):
            while len(errors) < 7:
                await asyncio.sleep(0.001)
        await task.stop()

    asyncio.run(scenario())
    assert errors == ["", *(f"OSError: {what}" for what in "aaabbb")]
    told = [f"the watch: OSError: {what}; it is being restarted" for what in "abb"]
    assert [record.getMessage() for record in caplog.records] == told


def test_a_task_that_ends_again_and_again_is_started_ever_less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """After it has been well, the pauses begin anew."""
    monkeypatch.setattr(supervision, "PAUSE", 0.001)
    monkeypatch.setattr(supervision, "LONGEST_PAUSE", 0.003)
    pauses: list[float] = []
    sleep = asyncio.sleep

    async def noted(seconds: float) -> None:
        pauses.append(seconds)
        await sleep(seconds)

    async def body() -> None:
        if len(pauses) == 4:
            async with asyncio.timeout(10.0):
                while task.error:
                    await sleep(0.001)
        if len(pauses) == 6:
            await sleep(60.0)
        raise OSError("a damaged file")

    task = Supervised("the watch", body)

    async def scenario() -> None:
        task.start()
        async with asyncio.timeout(10.0):
            while len(pauses) < 6:
                await sleep(0.001)
        await task.stop()

    monkeypatch.setattr(asyncio, "sleep", noted)
    asyncio.run(scenario())
    assert pauses == [0.001, 0.002, 0.003, 0.003, 0.001, 0.002]


def test_a_task_that_is_stopped_has_ended_and_can_be_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervision, "PAUSE", 0.001)
    began, ended = 0, 0
    cancel = asyncio.Event()

    async def body() -> None:
        nonlocal began, ended
        began += 1
        try:
            await cancel.wait()
        finally:
            await asyncio.sleep(0.0)  # as where a connection is closed
            ended += 1
        cancel.clear()
        raise asyncio.CancelledError

    task = Supervised("the watch", body)

    async def until(lives: int) -> None:
        async with asyncio.timeout(10.0):
            while began < lives:
                await asyncio.sleep(0.001)

    async def scenario() -> None:
        await task.stop()  # nothing runs yet
        for lives in (1, 2):
            task.start()
            await until(lives)
            await task.stop()
            assert ended == lives
            await asyncio.sleep(0.01)
            assert (began, ended, task.failures) == (lives, lives, 0)
        task.start()
        await until(3)
        cancel.set()
        await until(4)
        assert task.failures == 1
        await task.stop()

    asyncio.run(scenario())


def test_a_task_that_fails_at_once_is_not_started_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervision, "PAUSE", 60.0)
    lives = 0

    async def body() -> None:
        nonlocal lives
        lives += 1
        if lives > 3:
            await asyncio.sleep(60.0)
        raise OSError("no such file")

    async def scenario() -> None:
        task = Supervised("the watch", body)
        task.start()
        for _ in range(20):
            await asyncio.sleep(0.0)
        assert (lives, task.failures) == (1, 1)
        await task.stop()

    asyncio.run(scenario())
