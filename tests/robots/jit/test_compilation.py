"""The progress of a compilation: what is still to come, what is done, how long it will take."""

import io
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from rich.console import Console

import contactsense
from contactsense.robots.jit import compilation as module
from contactsense.robots.jit.compilation import Compilation, CompilationProgress
from contactsense.robots.jit.progress_bar import CompilationBar


class Clock:
    """A clock that is moved by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def _compiled(name: str) -> Any:
    """Stands for a compiled function of that name."""

    def function() -> None:
        pass

    function.__module__, function.__qualname__ = "contactsense.m", name
    return SimpleNamespace(py_func=function, overloads={}, _cache=None)


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "times.yaml"
    path.write_text(yaml.safe_dump({"m.outer": [60.0], "m.inner": [20.0, 20.0]}))
    monkeypatch.setattr(module, "_TIMES", path)


@pytest.mark.usefixtures("table")
def test_share_and_time_left_follow_the_measured_times_and_this_machines_speed() -> None:
    outer, inner = _compiled("outer"), _compiled("inner")
    clock, seen = Clock(), list[CompilationProgress]()
    follow = Compilation([outer, inner], seen.append, clock)
    assert not follow.active
    event_outer, event_inner = (SimpleNamespace(data={"dispatcher": c}) for c in (outer, inner))
    follow.on_start(event_outer)
    assert follow.active
    assert follow.progress == (0.0, 100.0)
    clock.now = 30.0
    follow.on_start(event_inner)  # a call: the time of `outer` stands still
    assert follow.progress.share == pytest.approx(0.3)
    clock.now = 70.0  # twice as long as measured
    follow.on_end(event_inner)
    slowness = (40.0 + 5.0) / (20.0 + 5.0)
    share, left = follow.progress
    assert share >= 0.3
    assert left == pytest.approx(slowness * 100.0 * (1.0 - share))
    shares = [progress.share for progress in seen]
    assert shares == sorted(shares)
    clock.now = 1e4
    assert follow.progress.share < 0.8  # what is not finished never counts in full
    follow.on_end(event_outer)
    assert follow.progress.share == pytest.approx(0.8)
    assert follow.times == [("m.inner", 40.0), ("m.outer", pytest.approx(30.0 + 1e4 - 70.0))]


@pytest.mark.usefixtures("table")
def test_what_is_in_the_cache_does_not_count() -> None:
    outer, inner = _compiled("outer"), _compiled("inner")
    inner.overloads = {"one version": None}
    assert module.uncached([outer, inner]) == {"m.outer": [60.0], "m.inner": [20.0]}
    inner.overloads = {"one version": None, "another": None}
    assert module.uncached([outer, inner]) == {"m.outer": [60.0], "m.inner": []}


PROGRAM = """
from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.compilation import Compilation
import numpy as np
seen = []
with Compilation([dot6], seen.append) as compilation:
    dot6(np.ones(6), np.ones(6))
print(compilation.active, len(seen), seen[-1].share if seen else None)
"""


@pytest.mark.slow
def test_numbas_events_are_followed_and_a_second_run_compiles_nothing(tmp_path: Path) -> None:
    place = str(Path(contactsense.__path__[0]).parent)
    environment = {**os.environ, "PYTHONPATH": place, "NUMBA_CACHE_DIR": str(tmp_path)}
    for expected in ("True 3 1.0", "False 0 None"):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == expected


def test_the_table_covers_the_localizer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Functions that are missing in it count as the median; most must be there."""
    from contactsense import Scene
    from contactsense.stream_localizer import kernels_of

    monkeypatch.setattr(module, "_cached_versions", lambda compiled: 0)
    needed = module.uncached(kernels_of(Scene(robot="ur5e", contacts=3)))
    table = yaml.safe_load(Path(module.__file__).with_name("compile_times.yaml").read_text())
    assert len(needed) > 100
    assert len(needed.keys() & table.keys()) > 0.8 * len(needed)


def test_a_bar_on_a_terminal_and_lines_elsewhere() -> None:
    terminal = io.StringIO()
    bar = CompilationBar(Console(file=terminal, force_terminal=True, width=100))
    bar.update(CompilationProgress(0.43, 70.0))
    time.sleep(0.3)  # it is drawn by a thread
    bar.update(CompilationProgress(1.0, 0.0))
    assert "43 %, about 70 s left" in terminal.getvalue()
    lines = io.StringIO()
    plain = CompilationBar(Console(file=lines))
    for share in (0.40, 0.43, 0.52, 1.0):
        plain.update(CompilationProgress(share, 70.0))
    assert lines.getvalue().splitlines() == [
        "compiling kernels: 40 %, about 70 s left",
        "compiling kernels: 52 %, about 70 s left",
    ]
