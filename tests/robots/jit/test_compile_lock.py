"""Processes that start together compile each kernel once."""

import os
import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import pytest

import contactsense
from contactsense.robots.files.file_lock import POLL
from contactsense.robots.jit.compile_lock import compile_lock

KERNELS = """
from contactsense.robots.jit.kernel import kernel

@kernel
def inner(x):
    return x + 1.0

@kernel
def outer(x):
    return 2.0 * inner(x)
"""
PROGRAM = """
import sys
from kernels import inner, outer
print("ready", flush=True)
sys.stdin.readline()
print(outer(1.0), sum(sum(f.stats.cache_misses.values()) for f in (outer, inner.called_by_kernels)))
"""


def test_one_at_a_time_holds_it(tmp_path: Path) -> None:
    held, release, order = Event(), Event(), []

    def hold() -> None:
        with compile_lock(tmp_path / "lock") as mine:
            order.append(mine)
            held.set()
            release.wait()
            order.append("released")

    first = Thread(target=hold)
    first.start()
    held.wait()
    second = Thread(target=hold)
    second.start()
    second.join(5.0 * POLL)
    assert order == [True]
    release.set()
    first.join()
    second.join()
    assert order == [True, "released", True, "released"]


def test_who_waits_for_too_long_goes_on_without_it(tmp_path: Path) -> None:
    with compile_lock(tmp_path / "lock") as first, compile_lock(tmp_path / "lock", 2.0 * POLL) as second:
        assert first
        assert not second
    with compile_lock(tmp_path / "lock", 0.0) as third:
        assert third


def test_nobody_holds_it_where_no_file_can_be_made(tmp_path: Path) -> None:
    with compile_lock(tmp_path / "absent" / "lock") as mine:
        assert not mine


def test_an_error_while_it_is_held_is_told_and_releases_it(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="disk full"), compile_lock(tmp_path / "lock"):
        raise OSError("disk full")
    with compile_lock(tmp_path / "lock", 0.0) as mine:
        assert mine


@pytest.mark.slow
def test_processes_that_start_together_compile_once(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS)
    path = os.pathsep.join([str(tmp_path), str(Path(contactsense.__path__[0]).parent)])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    both = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for process in both:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in both:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    found = [process.communicate()[0].split() for process in both]
    assert [result for result, _ in found] == ["4.0", "4.0"]
    # The one that waited did not need the function that the other one calls.
    assert sorted(int(misses) for _, misses in found) == [0, 2]
