"""The examples run as they are, and find what they show."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import contactsense
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


def _ended(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    place = str(Path(contactsense.__path__[0]).parent)
    return subprocess.run(
        [sys.executable, "-W", "error", str(ROOT / "examples" / name), *arguments],
        env={**os.environ, "PYTHONPATH": place},
        capture_output=True,
        text=True,
    )


def _run(name: str, *arguments: str) -> str:
    done = _ended(name, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_first_lines() -> None:
    out = _run("01_first_lines.py")
    assert out.startswith("status: contact")
    assert "on forearm" in out


def test_first_lines_uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Division by zero, which the kernels rely on, is no warning, and the result is the same."""
    compiled = _run("01_first_lines.py")
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert _run("01_first_lines.py") == compiled


@pytest.mark.realtime
def test_live_loop() -> None:
    out = _run("02_live_loop.py")
    assert "onset" in out
    assert "samples; " in out


def test_offline_file() -> None:
    lines = _run("03_offline_file.py").splitlines()
    assert len(lines) == 8
    assert all(" N at " in line for line in lines)


def test_an_offline_file_in_milliseconds_is_not_said_to_be_without_contact(tmp_path: Path) -> None:
    rows = np.column_stack([2.0 * np.arange(200), np.zeros((200, 12)), np.zeros((200, 6)), np.ones((200, 6))])
    groups = ("actual_q", "actual_qd", "joint_torque", "base_wrench")
    head = ",".join(["timestamp", *(f"{name}_{i}" for name in groups for i in range(6))])
    np.savetxt(tmp_path / "ms.csv", rows, delimiter=",", header=head, comments="")
    scene = str(ROOT / "examples" / "cells" / "base_sensor.yaml")
    out = _run("03_offline_file.py", str(tmp_path / "ms.csv"), scene)
    assert "no sample could be used: " in out
    assert "t: expected at most 0.15 s from one sample to the next, got 2 s" in out
    assert "no contact" not in out


@pytest.mark.parametrize("name", ["02_live_loop.py", "03_offline_file.py"])
def test_half_of_the_arguments_is_no_simulation(name: str) -> None:
    """Whoever names a robot and forgets the sensor must not take the simulated arm for their own."""
    with pytest.raises(AssertionError, match=r"expected .*, or nothing for a simulated"):
        _run(name, "one")


@pytest.mark.parametrize(
    ("name", "arguments", "reason"),
    [
        ("02_live_loop.py", ("127.0.0.1", ""), "force/torque sensor at :49152: "),
        ("03_offline_file.py", ("none.csv", "none.yaml"), "none.yaml: cannot read the scene: "),
        ("03_offline_file.py", ("none.csv", "CELL"), "none.csv: cannot read the recording: "),
        ("05_own_controller.py", ("http://127.0.0.1:1",), "expected ws://ADDRESS:PORT, got http:"),
        ("05_own_controller.py", ("ws://127.0.0.1:99999",), "expected ws://ADDRESS:PORT, got ws:"),
        ("05_own_controller.py", ("ws://127.0.0.1:1",), "ws://127.0.0.1:1: no service answers"),
    ],
)
def test_wrong_arguments_are_told_in_one_line(name: str, arguments: tuple[str, ...], reason: str) -> None:
    cell = str(ROOT / "examples" / "cells" / "base_sensor.yaml")
    done = _ended(name, *(cell if argument == "CELL" else argument for argument in arguments))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert done.stderr.startswith(reason)


def test_a_robot_that_is_not_there_is_told() -> None:
    with pytest.raises(AssertionError, match=r"no samples: .*127\.0\.0\.2:30004"):
        _run("02_live_loop.py", "127.0.0.2", "127.0.0.2")


@pytest.mark.realtime
def test_own_controller() -> None:
    lines = _run("05_own_controller.py").splitlines()
    assert lines[0].startswith("links of the ur5e: base, ")
    assert sum("onset" in line for line in lines) == 4
    held = [line.split()[4].rstrip(",") for line in lines if "hold on" in line]
    assert held == [touch.link for touch in simulate(Script.demo()).touches[:4]]


def test_a_service_that_is_not_named_is_not_started() -> None:
    with pytest.raises(AssertionError, match=r"expected ws://ADDRESS:PORT, or nothing"):
        _run("05_own_controller.py", "ws://127.0.0.1:8000", "push")


def test_a_service_that_is_not_there_is_told() -> None:
    with pytest.raises(AssertionError, match=r"ws://127\.0\.0\.1:9: no service answers"):
        _run("05_own_controller.py", "ws://127.0.0.1:9")


@pytest.mark.long
@pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("trimesh", "yourdfpy", "embreex")),
    reason="the packages of contactsense[geometry] are not installed or have no wheels here",
)
def test_own_arm() -> None:
    out = _run("04_own_arm.py")
    assert "contact on fore" in out


def test_each_example_is_run() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    for path in (ROOT / "examples").glob("*.py"):
        assert f'_run("{path.name}")' in text
