"""How urgently a thread is scheduled: asked for, granted or not, and taken back."""

import os
import sys
import threading
from collections.abc import Callable

import pytest

from contactsense.service.live import scheduling

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux is asked for it")


def in_a_thread(what: Callable[[], object]) -> object:
    found: list[object] = []
    thread = threading.Thread(target=lambda: found.append(what()))
    thread.start()
    thread.join()
    return found[0]


def permitted() -> bool:
    def ask() -> bool:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except OSError:
            return False
        return True

    return bool(in_a_thread(ask))


@pytest.mark.skipif(not permitted(), reason="this user may not run anything in real time")
def test_real_time_is_taken_and_given_back() -> None:
    def policies() -> list[object]:
        told = scheduling.prioritize(scheduling.PIPELINE, reset_on_fork=True)
        policy, priority = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        inherited = in_a_thread(lambda: os.sched_getscheduler(0))
        scheduling.deprioritize()
        after = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        return [told, policy & ~os.SCHED_RESET_ON_FORK, priority, inherited, after]

    assert in_a_thread(policies) == [
        "real time",
        os.SCHED_FIFO,
        scheduling.PIPELINE,
        os.SCHED_OTHER,
        os.SCHED_OTHER,
    ]


def test_what_is_refused_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert in_a_thread(lambda: scheduling.prioritize(scheduling.PIPELINE)) in ("short slices", "normal")
    monkeypatch.setattr(scheduling, "_SCHED_SETATTR", {})
    assert in_a_thread(lambda: scheduling.prioritize(scheduling.PIPELINE)) == "normal"
