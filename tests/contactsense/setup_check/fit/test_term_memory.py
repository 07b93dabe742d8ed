"""Terms that are used again are worked out once, as long as there is room."""

import numpy as np
import pytest

from contactsense.setup_check.fit import term_memory
from contactsense.setup_check.fit.term_memory import TermMemory


def test_the_terms_that_were_used_last_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(term_memory, "_LIMIT", 3 * 80)
    worked_out: list[str] = []

    def terms(key: str) -> np.ndarray:
        def found() -> np.ndarray:
            worked_out.append(key)
            return np.full(10, float(ord(key)))

        return memory.get(key, found)

    memory = TermMemory()
    for key in "abcabcdaef":
        np.testing.assert_array_equal(terms(key), ord(key))
    # d takes the place of a, that of b, e that of c, f that of d.
    assert worked_out == list("abcdaef")
    terms("a")
    assert worked_out == list("abcdaef")


def test_terms_that_are_larger_than_the_room_are_the_only_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(term_memory, "_LIMIT", 50)
    memory, made = TermMemory(), []
    for key in "aabb":
        memory.get(key, lambda key=key: made.append(key) or np.zeros(10))
    assert made == ["a", "b"]
