"""Compiled code on disk must never outlive anything that went into it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.errors import NumbaError

import contactsense
from contactsense.robots.jit.kernel import allocating_kernel, kernel

OUTER = (
    "from contactsense.robots.jit.kernel import kernel\n"
    "from inner import SCALE, inner\n"
    "@kernel\n"
    "def outer(x):\n"
    "    return SCALE * later(x)\n"
    "@kernel\n"
    "def later(x):\n"
    "    return inner(x)\n"
)


def _inner(scale: float, offset: float) -> str:
    return (
        "from contactsense.robots.jit.kernel import kernel\n"
        f"SCALE = {scale}\n"
        "@kernel\n"
        "def inner(x):\n"
        f"    return x + {offset}\n"
    )


def _run(folder: Path) -> float:
    path = os.pathsep.join([str(folder), str(Path(contactsense.__path__[0]).parent)])
    program = "from outer import outer; print(outer(1.0), *outer.stats.cache_hits.values())"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    result, *hits = done.stdout.split()
    _run.hits = sum(map(int, hits))  # type: ignore[attr-defined]
    return float(result)


@pytest.mark.slow
def test_the_cache_depends_on_other_files(tmp_path: Path) -> None:
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "inner.py").write_text(_inner(1.0, 1.0))
    assert _run(tmp_path) == 2.0
    assert _run.hits == 0  # type: ignore[attr-defined]
    assert _run(tmp_path) == 2.0
    assert _run.hits == 1  # type: ignore[attr-defined]
    # What it calls comes from the cache then, and is linked into it.
    (tmp_path / "outer.py").write_text(OUTER.replace("SCALE * later(x)", "2.0 * SCALE * later(x)"))
    assert _run(tmp_path) == 4.0
    (tmp_path / "outer.py").write_text(OUTER)
    (tmp_path / "inner.py").write_text(_inner(1.0, 10.0))
    assert _run(tmp_path) == 11.0
    (tmp_path / "inner.py").write_text(_inner(3.0, 10.0))
    assert _run(tmp_path) == 33.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        # Numba compares the types of the fields only.
        ("numerator: Floats; denominator: Floats", "denominator: Floats; numerator: Floats", (0.5, 2.0)),
        ("PART = slice(0, 1)", "PART = slice(1, 2)", (0.5, 1.0)),
        ("TABLE = np.array([1.0, 2.0])", "TABLE = np.array([3.0, 2.0])", (0.5, 1.5)),
    ],
)
def test_the_cache_depends_on_declarations_and_constants_of_other_files(
    tmp_path: Path, before: str, after: str, expected: tuple[float, float]
) -> None:
    inner = (
        "import numpy as np\n"
        "from typing import Annotated, NamedTuple\n"
        "from contactsense.robots.jit.declaration import Floats\n"
        "PART = slice(0, 1)\n"
        "TABLE = np.array([1.0, 2.0])\n"
        "class Ratio(NamedTuple):\n"
        "    numerator: Floats; denominator: Floats\n"
        "class Holder(NamedTuple):\n"
        "    ratio: Annotated[Ratio, 'held']\n"
    )
    (tmp_path / "outer.py").write_text(
        "import numpy as np\n"
        "from contactsense.robots.jit.kernel import kernel\n"
        "from inner import PART, TABLE, Holder, Ratio\n"
        "@kernel\n"
        "def _outer(holder: Holder) -> float:\n"
        "    ratio = holder.ratio\n"
        "    return TABLE[0] * ratio.numerator[PART][0] / ratio.denominator[0]\n"
        "def outer(x):\n"
        "    return _outer(Holder(Ratio(np.array([x, 2.0 * x]), np.array([2.0 * x, x]))))\n"
        "outer.stats = _outer.stats\n"
    )
    for text, result in zip((inner, inner.replace(before, after)), expected, strict=True):
        (tmp_path / "inner.py").write_text(text)
        assert _run(tmp_path) == result
        assert _run.hits == 0  # type: ignore[attr-defined]
    assert _run(tmp_path) == expected[1]
    assert _run.hits == 1  # type: ignore[attr-defined]


@pytest.mark.slow
def test_with_nowhere_to_write_kernels_are_compiled_in_memory() -> None:
    program = (
        "import numba.core.caching as caching\n"
        "caching.CacheImpl._locator_classes = []\n"
        "import numpy as np\n"
        "from contactsense.kinematics.spatial import dot6\n"
        "print(dot6(np.ones(6), np.ones(6)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "6.0"


@pytest.mark.slow
def test_a_class_of_arguments_that_is_gone_leaves_no_trace(tmp_path: Path) -> None:
    """Numba lists types of arguments by name: one that was renamed must not keep the rest from loading."""
    (tmp_path / "inner.py").write_text(
        "from contactsense.robots.jit.kernel import kernel\n"
        "@kernel\ndef inner(pair):\n    return pair.a + pair.b\n"
    )
    for name in ("Pair", "Couple"):
        (tmp_path / "outer.py").write_text(
            "from typing import NamedTuple\n"
            "from inner import inner as outer_inner\n"
            f"class {name}(NamedTuple):\n"
            "    a: float\n"
            "    b: float\n"
            "def outer(x):\n"
            f"    return outer_inner({name}(x, 2.0 * x))\n"
            "outer.stats = outer_inner.stats\n"
        )
        assert _run(tmp_path) == 3.0


def _half(x: np.ndarray) -> float:
    y = np.empty(x.shape[0])
    for i in range(x.shape[0]):
        y[i] = 0.5 * x[i]
    return float(y[0])


def _move_down(x: np.ndarray) -> None:
    x[1:] = x[:-1]


@pytest.mark.parametrize("function", [_half, _move_down])
def test_a_kernel_that_would_allocate_is_refused(function: Callable[..., Any]) -> None:
    with pytest.raises(NumbaError, match=r"NRT required|returning of array"):
        kernel(function)(np.ones(3))


def _part_and_length(x: np.ndarray) -> tuple[tuple[np.ndarray, float], int]:
    return (x[1:], 1.0), len(x)


def test_a_kernel_that_would_return_a_part_of_an_array_is_refused() -> None:
    # Python would get the whole array instead.
    with pytest.raises(TypeError, match="_part_and_length: a kernel cannot return arrays to Python"):
        kernel(_part_and_length)(np.ones(3))


def test_an_allocating_kernel_may() -> None:
    assert allocating_kernel(_half)(np.ones(3)) == 0.5


@kernel
def _called(x: float, power: int) -> float:
    return x**power


@kernel
def _calls(x: float) -> float:
    return _called(x, 2) + _called(x, 3)  # type: ignore[no-any-return]


def test_a_kernel_called_by_kernels_is_not_compiled_for_python() -> None:
    assert _calls(2.0) == 12.0
    _calls.recompile()  # from the cache, it would come without what it calls
    assert _calls(2.0) == 12.0
    assert _called.signatures == []
    # One version, whatever the constants, which is no machine code.
    (compiled,) = _called.called_by_kernels.overloads.values()
    assert list(compiled.library.get_defined_functions()) == []
    with pytest.raises(TypeError, match="expected a call by a kernel"):
        _called.called_by_kernels(2.0, 2)
    assert _called(2.0, 4) == 16.0
    assert len(_called.signatures) == 1
