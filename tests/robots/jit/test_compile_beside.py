"""A first compilation with a second process: what that one compiles, this one loads."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import contactsense

KERNELS = """
import os, time
from pathlib import Path
from numba.extending import overload
from contactsense.robots.jit.kernel import kernel

def same(x):
    return x

@overload(same)
def _compile_same(x):
    end = time.monotonic() + float(os.environ["PATIENCE"])
    while not list(Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*second*.nbi")) and time.monotonic() < end:
        time.sleep(0.02)
    return lambda x: x

@kernel
def first(x):
    return same(x) + 1.0

@kernel
def second(x):
    return 2.0 * x

@kernel
def root(x):
    return first(x) + second(x)
"""
"""`first` takes until there is machine code of `second`."""
PROGRAM = """
import json, sys
from kernels import root, second
from contactsense.robots.jit import compile_beside
from contactsense.robots.jit.compilation import Compilation
if sys.argv[1:]:
    compile_beside._PROGRAM = sys.argv[1]
with Compilation([root]) as compilation, compile_beside.compiled_beside(root, second, 1.0):
    value = root(1.0)
names = [name.rpartition(".")[2] for name, _ in compilation.times]
print(json.dumps([value, sorted(set(names) & {"first", "second", "root"}), compilation.progress.share]))
"""


def _compiled_here(folder: Path, *arguments: str, patience: float = 60.0) -> list[str]:
    """What the first process compiles itself."""
    (folder / "kernels.py").write_text(KERNELS)
    place = os.pathsep.join((str(folder), str(Path(contactsense.__path__[0]).parent)))
    cache = {"NUMBA_CACHE_DIR": str(folder / "cache"), "PATIENCE": str(patience)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        env={**os.environ, "PYTHONPATH": place, **cache},
        capture_output=True,
        text=True,
        check=True,
    )
    value, names, share = json.loads(done.stdout)
    assert value == 4.0
    assert share == 1.0
    compiled: list[str] = names
    return compiled


@pytest.mark.slow
def test_the_other_process_compiles_its_part(tmp_path: Path) -> None:
    assert _compiled_here(tmp_path) == ["first", "root"]


@pytest.mark.slow
def test_without_it_this_one_compiles_all(tmp_path: Path) -> None:
    assert _compiled_here(tmp_path, "raise SystemExit(1)", patience=0.0) == ["first", "root", "second"]
