"""Ctrl-C in a terminal, or SIGTERM, ends a command and all of its processes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.service.loopback import until


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_decomposition_ends_with_its_workers(tmp_path: Path, number: signal.Signals) -> None:
    """Ctrl-C reaches the whole process group. The pipe of the messages closes when the last process ends."""
    out = tmp_path / "surface.yaml"
    command = subprocess.Popen(
        [sys.executable, "-P", "-m", "contactsense", "decompose", "ur5e", "--out", str(out)],
        stderr=subprocess.PIPE,
        start_new_session=True,
        # A shell lets programs in the background ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    proc = Path(f"/proc/{command.pid}")

    def works() -> bool:
        """Two workers are there, beside the resource tracker of multiprocessing, and signals are handled."""
        status = dict(line.split(":\t", 1) for line in (proc / "status").read_text().splitlines())
        handled = int(status["SigCgt"], 16) >> signal.SIGINT - 1 & 1
        children = (proc / "task" / str(command.pid) / "children").read_text().split()
        return len(children) >= 3 and handled == 1

    try:
        assert until(works, 30.0)
        if number == signal.SIGINT:
            os.killpg(command.pid, number)
        else:
            command.send_signal(number)
        _, messages = command.communicate(timeout=120)
    finally:
        if command.poll() is None:
            os.killpg(command.pid, signal.SIGKILL)
    # CPython ends by SIGINT itself, whoever has caught the exception, if it came within exec("...").
    assert command.returncode in (1, -signal.SIGINT)
    assert "contactsense: interrupted" in messages.decode().splitlines()
    assert "Traceback" not in messages.decode()
    assert not out.exists()
