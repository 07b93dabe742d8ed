"""What the second process of a first compilation is told."""

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numba
import pytest

from contactsense import Localizer, Scene, stream_localizer


def test_its_types_are_those_with_which_the_localizer_calls_its_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """Machine code for other types would be of no use."""
    told: list[Any] = []

    def beside(*arguments: Any) -> AbstractContextManager[None]:
        told.extend(arguments)
        return nullcontext()

    monkeypatch.setattr(stream_localizer, "compiled_beside", beside)
    Localizer(Scene(robot="ur5e"))
    _, part, *examples = told
    known = part.called_by_kernels._cache._cache_file._load_index()
    assert tuple(numba.typeof(example) for example in examples) in {types for types, *_ in known}
