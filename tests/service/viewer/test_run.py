"""The loop that draws."""

import threading

import pytest

from contactsense.service.viewer.viewer import run


def test_it_goes_on_where_an_event_of_another_thread_is_set_too_soon() -> None:
    over, calls = threading.Event(), []

    def draw() -> None:
        calls.append(None)
        if len(calls) == 1:
            raise RuntimeError("deque mutated during iteration")
        over.set()

    run(draw, over)
    assert len(calls) == 2


def test_it_ends_with_any_other_error() -> None:
    def draw() -> None:
        raise RuntimeError("another one")

    with pytest.raises(RuntimeError, match="another one"):
        run(draw, threading.Event())
