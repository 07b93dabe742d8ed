"""Executes a program from a client, statement by statement."""

from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from contactsense.service.mock.arm.script import Watchdog
from contactsense.service.mock.controller.motion_generator import MotionGenerator
from contactsense.service.mock.urscript.functions import joint_positions, positive
from contactsense.service.mock.urscript.parser import CONTROL_SCRIPT, Program, Statement

_MOVE_SPEED, _MOVE_ACCELERATION = 1.05, 1.4  # defaults of movej [rad/s, rad/s^2]
_STOP_DECELERATION = 2.0


class Command(IntEnum):
    """Commands of ur_rtde's control interface that the mock executes, numbered as in its control script."""

    MOVEJ = 1
    PROTECTIVE_STOP = 31
    STOPL = 33
    STOPJ = 34
    STOP_SCRIPT = 255


class CommandedController(Protocol):
    """What a program needs of the controller that executes it."""

    motion: MotionGenerator
    popup: str
    inputs: dict[str, tuple[Any, ...]]
    outputs: dict[str, tuple[Any, ...]]

    def send_message(self, message: str) -> None:
        """Log a message and send it to all listeners."""

    def protective_stop(self, reason: str) -> None:
        """Stop the arm until the stop is unlocked."""

    def set_watchdog(self, watchdog: Watchdog) -> None:
        """Watch an input register from now on."""


class ProgramRunner:
    """A running program.

    Args:
        program: The program to execute.
        controller: The controller that executes it.
    """

    def __init__(self, program: Program, controller: CommandedController) -> None:
        self._program = program
        self._controller = controller
        self._waiting = list(program.statements)
        self._sleep = 0.0
        self._moving = False
        self._interface = ControlInterface(program, controller) if program.name == CONTROL_SCRIPT else None
        self.done = False

    @property
    def decelerates(self) -> bool:
        """Whether the program itself begins by stopping the arm."""
        return bool(self._waiting) and self._waiting[0].name in ("stopj", "stopl")

    def step(self, dt: float) -> None:
        """Execute the statements that are due, `dt` [s] after the previous step."""
        if self._interface is not None:
            self._interface.step()
            self.done = self._interface.done
            return
        self._sleep -= dt
        while not self.done and self._sleep <= 0.0 and not (self._moving and not self._at_rest()):
            self._moving = False
            if not self._waiting:
                self.done = True
                return
            self._do(self._waiting.pop(0))

    def _at_rest(self) -> bool:
        return self._controller.motion.at_rest

    def _do(self, statement: Statement) -> None:
        given, controller = statement.arguments, self._controller
        match statement.name:
            case "stopj" | "stopl":
                controller.motion.stop(given.get("a", _STOP_DECELERATION))
                self._moving = True
            case "movej":
                if not self._at_rest():
                    self._waiting.insert(0, statement)
                    self._moving = True
                    return
                speed, acceleration = given.get("v", _MOVE_SPEED), given.get("a", _MOVE_ACCELERATION)
                controller.motion.move(np.array(given["q"]), speed, acceleration)
                self._moving = True
            case "sleep":
                self._sleep = given["t"]
            case "textmsg":
                controller.send_message("".join(str(text) for text in given.values()))
            case "popup":
                controller.popup = str(given["s"])
                controller.send_message(f"popup: {given['s']}")
            case "protective_stop":
                controller.protective_stop("asked for by a program")
            case "halt":
                self.done = True
            case "rtde_set_watchdog":
                controller.set_watchdog(
                    Watchdog(
                        variable=given["variable_name"],
                        min_frequency=given["min_frequency"],
                        action=given.get("action", "pause"),
                    )
                )
            case _:
                self._write(statement.name, given)

    def _write(self, name: str, given: dict[str, Any]) -> None:
        kind = {"integer": "int", "float": "double", "boolean": "bit"}
        if not name.startswith("write_output_"):
            return  # sync: nothing to wait for
        register = f"output_{kind[name.split('_')[2]]}_register_{given['address']}"
        self._controller.outputs[register] = (given["value"],)


class ControlInterface:
    """The program of ur_rtde's control interface, which reads commands from input registers.

    A command is a number in the first integer register. It is done when the first integer output register is
    2. The next command may follow when the command is 0 again and the output register is 1.
    """

    def __init__(self, program: Program, controller: CommandedController) -> None:
        self._controller = controller
        self._offset = program.register_offset
        self._running = False
        self._begun = False
        self.done = False
        self._answer(1)

    def step(self) -> None:
        """Read the registers and execute a new command."""
        command = int(self._integer(0))
        if command == 0:
            self._running = self._begun = False
            self._answer(1)
            return
        if not self._begun:
            self._begun = self._running = True
            self._begin(command)
        if self._running and (self._integer(1) or self._controller.motion.at_rest):
            self._running = False
            self._answer(2)

    def _begin(self, command: int) -> None:
        try:
            self._execute(command)
        except ValueError as error:
            self._controller.send_message(f"ur_rtde: command {command} not executed: {error}")

    def _execute(self, command: int) -> None:
        motion = self._controller.motion
        match command:
            case Command.MOVEJ:
                q = joint_positions([self._float(j) for j in range(6)])
                motion.move(np.array(q), positive(self._float(6)), positive(self._float(7)))
            case Command.PROTECTIVE_STOP:
                self._controller.protective_stop("asked for by ur_rtde")
            case Command.STOPL | Command.STOPJ:
                motion.stop(positive(self._float(0)))
            case Command.STOP_SCRIPT:
                self.done = True
            case _:
                self._controller.send_message(f"ur_rtde: the mock does not simulate command {command}")

    def _answer(self, value: int) -> None:
        self._controller.outputs[f"output_int_register_{self._offset}"] = (value,)

    def _integer(self, number: int) -> int:
        return int(self._controller.inputs.get(f"input_int_register_{self._offset + number}", (0,))[0])

    def _float(self, number: int) -> float:
        return float(self._controller.inputs.get(f"input_double_register_{self._offset + number}", (0.0,))[0])
