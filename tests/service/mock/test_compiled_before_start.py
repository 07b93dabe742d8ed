"""The simulated controller compiles before it starts: later, it would hold up the sensors' readings."""

import subprocess
import sys

import pytest

PROGRAM = """
from contactsense.robots.jit import kernel
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.arm.script import Script

script = Script.demo()
robot = RobotController(Cell.of_script(script), script)
loaded = {compiled for compiled in kernel._SOURCES if compiled.signatures}
robot.advance_to(0.1)
print([compiled.__name__ for compiled in kernel._SOURCES if compiled.signatures and compiled not in loaded])
"""


@pytest.mark.slow
def test_the_arm_moves_without_compiling_further():
    # In a process of its own: here, other tests have compiled all of it.
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.stdout == "[]\n", done.stdout + done.stderr
