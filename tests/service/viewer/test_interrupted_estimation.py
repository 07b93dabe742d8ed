"""A recording of hours is estimated for minutes before the page is there: a signal ends that at once."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from contactsense.service.viewer import READY
from tests.service.analysis.recordings import demo, write_motion

pytestmark = pytest.mark.slow
PATIENCE = 120.0
"""Longest time for the process to begin, and to end [s]."""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_can_be_interrupted(tmp_path: Path, number: signal.Signals) -> None:
    recording = write_motion(demo(), tmp_path / "run.parquet", rounds=20)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    arguments = ["view", str(recording), "--scene", str(tmp_path / "scene.yaml"), "--port", "0"]
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "contactsense", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # Shells start background jobs with SIGINT ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:  # fmt: skip
        try:
            assert process.stderr is not None
            assert "the estimates are being computed" in process.stderr.readline()
            process.send_signal(number)
            printed, errors = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert process.returncode == 1
    assert READY not in printed
    assert errors.strip() == "contactsense: interrupted"
