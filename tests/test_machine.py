"""A test that asks for the machine has it to itself."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import conftest
from tests.machine import STARVED, StolenTime, machine


class Holder:
    """Asks for the machine in a thread: locks belong to an open file, so threads exclude each other, too."""

    def __init__(self, folder: Path, alone: bool) -> None:
        self.inside, self._leave = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, args=(folder, alone))
        self._thread.start()

    def _run(self, folder: Path, alone: bool) -> None:
        with machine(folder, alone=alone):
            self.inside.set()
            self._leave.wait(30.0)

    def leave(self) -> None:
        self._leave.set()
        self._thread.join(30.0)
        assert not self._thread.is_alive()


@contextmanager
def holders(folder: Path, *alone: bool) -> Iterator[list[Holder]]:
    """Ask one after another: each has come in, or waits, before the next one asks."""
    found: list[Holder] = []
    try:
        for one in alone:
            found.append(Holder(folder, one))
            found[-1].inside.wait(0.3)
        yield found
    finally:
        for holder in found:
            holder.leave()


@pytest.mark.parametrize("alone", [(False, True), (True, False), (True, True)])
def test_a_test_that_is_alone_excludes_all_others(alone: tuple[bool, bool], tmp_path: Path) -> None:
    with holders(tmp_path, *alone) as (first, second):
        assert first.inside.is_set()
        assert not second.inside.is_set()
        first.leave()
        assert second.inside.wait(30.0)


def test_all_others_share(tmp_path: Path) -> None:
    with holders(tmp_path, False, False, False) as found:
        assert all(holder.inside.wait(30.0) for holder in found)


def test_who_waits_to_be_alone_is_not_overtaken(tmp_path: Path) -> None:
    with holders(tmp_path, False, True, False) as (shares, alone, late):
        assert not alone.inside.is_set()
        assert not late.inside.is_set()
        shares.leave()
        assert alone.inside.wait(30.0)
        assert not late.inside.is_set()
        alone.leave()
        assert late.inside.wait(30.0)


def test_the_share_of_stolen_time_is_a_share() -> None:
    stolen = StolenTime()
    sum(range(10**6))
    assert 0.0 <= stolen.share <= 1.0


def _realtime_test(monkeypatch: pytest.MonkeyPatch, share: float, outcomes: list[bool]) -> list[bool]:
    """Run a test in real time with these outcomes while the host takes that share; returns those not used."""
    monkeypatch.setattr(conftest, "StolenTime", lambda: SimpleNamespace(share=share))
    monkeypatch.setattr(conftest, "wait_for_processor", lambda patience: None)

    def body() -> None:
        assert outcomes.pop(0)

    item = SimpleNamespace(
        get_closest_marker=lambda name: name,
        funcargs={},
        _fixtureinfo=SimpleNamespace(argnames=()),
        obj=body,
    )
    assert conftest.pytest_pyfunc_call(item)  # type: ignore[arg-type]
    return outcomes


def test_a_failure_in_real_time_counts_where_the_processors_were_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(AssertionError):
        _realtime_test(monkeypatch, 0.9 * STARVED, [False, True])


def test_it_is_repeated_where_the_host_took_them_away(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _realtime_test(monkeypatch, 2.0 * STARVED, [False, True, False]) == [False]


def test_it_is_skipped_where_that_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(pytest.skip.Exception, match="10%, 10%, 10%"):
        _realtime_test(monkeypatch, 0.1, [False, False, False, True])
