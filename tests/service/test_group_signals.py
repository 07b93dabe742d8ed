"""A signal to the whole process group is left to the parent, as long as there is one."""

import os
import signal
import subprocess
import sys

CHILD = """
import sys
from contactsense.service.group_signals import leave_to_parent
leave_to_parent()
print("ready", flush=True)
sys.stdin.read()
print("in order", flush=True)
"""
PARENT = f"""
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", {CHILD!r}], stdin=0, stdout=1)
print(child.pid, flush=True)
child.wait()
"""


def test_signals_are_ignored_while_the_parent_lives() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CHILD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGTERM)
        process.send_signal(signal.SIGINT)
        process.stdin.close()
        assert process.stdout.readline() == "in order\n"
    assert process.returncode == 0


def test_an_orphan_can_be_ended() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        words = {parent.stdout.readline().strip() for _ in range(2)}
        (pid,) = words - {"ready"}
        parent.kill()
        parent.wait()
        os.kill(int(pid), signal.SIGTERM)
        assert parent.stdout.read() == ""  # the orphan held the other end, and said nothing more
