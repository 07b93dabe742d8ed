"""The simulated controller: program, safety and arm, one step per millisecond on its own clock.

A request for the state at a given time advances the simulation to that time. Commands of clients take effect
with the next step. Between two commands the script determines everything.
"""

import threading
from collections import deque
from collections.abc import Callable
from math import isnan
from typing import Any

import numpy as np

from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.measured_velocity import measured_velocity
from contactsense.service.mock.arm.script import Script, ScriptError, Watchdog
from contactsense.service.mock.arm.simulated_arm import check_trajectory
from contactsense.service.mock.arm.surface_check import check_contacts
from contactsense.service.mock.controller.contact_log import ContactLog
from contactsense.service.mock.controller.motion_generator import MotionGenerator
from contactsense.service.mock.controller.program_runner import ProgramRunner
from contactsense.service.mock.controller.pushes import ScriptedPushes
from contactsense.service.mock.controller.robot_state import Reading, RuntimeState
from contactsense.service.mock.physics.arm_simulation import STEP, ArmSimulation
from contactsense.service.mock.urscript.parser import Program

KEPT = 4096
"""Number of past states that are kept for late requests."""
STOP_DECELERATION = 5.0
"""Deceleration of the fastest joint when a program ends or is stopped in motion [rad/s^2]."""
UNLOCK_AFTER = 5.0
"""Time after which a protective stop may be unlocked, as on UR's controllers [s]."""


class RobotController:
    """One simulated robot.

    Args:
        cell: Arm, tool, mounting, sensors.
        script: Its motion and the contacts on it.
        loop: Whether to repeat the trajectory after its end.

    Raises:
        ScriptError: The script does not fit the arm.
    """

    def __init__(self, cell: Cell, script: Script, *, loop: bool = False) -> None:
        self.cell = cell
        self.script = script
        self.lock = threading.RLock()
        """Must be held while the state is read or changed."""
        check_trajectory(script, cell.robot)
        self.motion = MotionGenerator(script.trajectory, loop=loop)
        self.arm = ArmSimulation(
            cell.robot,
            script.trajectory.start,
            tool=cell.tool,
            obstacles=script.obstacles,
            gravity=cell.gravity,
        )
        check_contacts(script, self.arm.robot)
        _check_start(self.arm, script, cell)
        self._pushes = ScriptedPushes(script, cell.link_names, loop=loop)
        self.contacts = ContactLog(script.obstacles, cell.link_names)
        """Log of the contacts with obstacles."""
        self._chance = np.random.default_rng(script.noise.seed)
        self._steps = 0
        self.runtime = RuntimeState.STOPPED
        self.protective = False
        self._protective_since = 0.0
        self._force_since: float | None = None
        self.slider = 1.0
        self.popup = ""
        """Text of the displayed popup; empty if there is none."""
        self.log: deque[str] = deque(maxlen=1000)
        """Messages from the controller and from clients."""
        self.on_message: list[Callable[[str], None]] = []
        """Functions that are called with every message."""
        self.inputs: dict[str, tuple[Any, ...]] = {}
        """Values that clients wrote: input field -> numbers."""
        self.outputs: dict[str, tuple[Any, ...]] = {}
        """Output registers that programs wrote."""
        self._written: dict[str, float] = {}
        self.watchdog = script.watchdog
        self._watched_since = 0.0
        self._runner: ProgramRunner | None = None
        self._history: deque[Reading] = deque(maxlen=KEPT)
        self.play()
        self._history.append(self._read())

    @property
    def now(self) -> float:
        """Simulated time since the start [s]."""
        return self._steps * STEP

    def advance_to(self, t: float) -> None:
        """Advance the simulation to time t [s]."""
        while self._steps * STEP < t - 0.5 * STEP:
            # Lock each step separately: commands need not wait until a backlog is processed.
            with self.lock:
                self._step()

    def at(self, t: float) -> Reading:
        """Advance to time t [s] and return the state at t, or the oldest or latest stored one if t is
        beyond."""
        self.advance_to(t)
        with self.lock:
            back = self._steps - round(t / STEP)
            return self._history[max(-len(self._history), min(-1, -1 - back))]

    def _step(self) -> None:
        self.arm.step(self.motion.target, self._pushes.at(self.now, self.arm.rotations))
        self._steps += 1
        self.motion.step(STEP)
        self._watch_program()
        self._watch_safety()
        self._watch_clients()
        self.contacts.note(self.now, self.arm)
        self._history.append(self._read())

    def _watch_program(self) -> None:
        if self._runner is not None and self.runtime is RuntimeState.PLAYING:
            self._runner.step(STEP)
            if self._runner.done:
                self._runner = None
                self.runtime = RuntimeState.STOPPED
        elif self._runner is None and self.runtime is RuntimeState.PLAYING and self.motion.finished:
            self.runtime = RuntimeState.STOPPED
        if self.runtime is RuntimeState.PAUSING and self.motion.at_rest:
            self.runtime = RuntimeState.PAUSED
        if self.runtime is RuntimeState.STOPPING and self.motion.at_rest:
            self.runtime = RuntimeState.STOPPED

    def _watch_safety(self) -> None:
        safety = self.script.safety
        if self.deviation >= 1.0:
            self.protective_stop("C153: a joint is too far from its target")
        if safety.force_limit is None:
            return
        if self.collision < 1.0:
            self._force_since = None
        elif self._force_since is None:
            self._force_since = self.now
        elif self.now - self._force_since >= safety.force_delay:
            self.protective_stop(f"C157: the external force is above {safety.force_limit:g} N")

    def _watch_clients(self) -> None:
        dog = self.watchdog
        if dog is None or dog.action == "ignore" or self.runtime is not RuntimeState.PLAYING:
            return
        last = max(self._written.get(dog.variable, 0.0), self._watched_since)
        if self.now - last > 1.0 / dog.min_frequency:
            self.send_message(f"watchdog: {dog.variable} is not written {dog.min_frequency:g} times a second")
            self._watched_since = self.now
            self.pause() if dog.action == "pause" else self.stop()

    @property
    def deviation(self) -> float:
        """Deviation from the target as a fraction of the limit for a protective stop."""
        off = np.abs(self.arm.target[0] - self.arm.q).max()
        return float(off) / self.script.safety.position_deviation

    @property
    def collision(self) -> float:
        """External force as a fraction of the limit for a protective stop; 0 if there is no limit."""
        limit = self.script.safety.force_limit
        return 0.0 if limit is None else float(np.linalg.norm(self.arm.external_wrench[:3])) / limit

    def set_watchdog(self, watchdog: Watchdog) -> None:
        """Start a watchdog, which requires that an input is written regularly."""
        self.watchdog, self._watched_since = watchdog, self.now

    def receive(self, inputs: dict[str, tuple[Any, ...]]) -> None:
        """Process the values that a client wrote to input fields."""
        with self.lock:
            self.inputs.update(inputs)
            self._written.update(dict.fromkeys(inputs, self.now))
            if self.inputs.get("speed_slider_mask", (0,))[0] and "speed_slider_fraction" in inputs:
                self.set_speed(float(inputs["speed_slider_fraction"][0]))

    def set_speed(self, fraction: float) -> None:
        """Set the speed slider to a fraction from 0 to 1; not a number: leave it."""
        with self.lock:
            if isnan(fraction):
                return
            self.slider = min(max(fraction, 0.0), 1.0)
            if self.runtime is RuntimeState.PLAYING:
                self.motion.wanted = self.slider

    def play(self) -> bool:
        """Start the script's trajectory, or resume it after a pause; returns whether that was possible: not
        in a protective stop, nor before a program that is being stopped has ended."""
        with self.lock:
            if self.protective or self.runtime is RuntimeState.STOPPING:
                return False
            self.motion.wanted = self.slider
            if self.runtime is RuntimeState.STOPPED:
                self.motion.start()
            elif self.runtime is RuntimeState.PAUSED and self._runner is None:
                self.motion.follow()
            self.runtime = RuntimeState.PLAYING
            self._watched_since = self.now
            return True

    def pause(self) -> bool:
        """Pause the motion along its path; returns whether a program runs."""
        with self.lock:
            if self.runtime is not RuntimeState.PLAYING:
                return False
            if self._runner is not None:
                self.motion.stop(STOP_DECELERATION)
            self.motion.wanted = 0.0
            self.runtime = RuntimeState.PAUSING
            return True

    def stop(self, deceleration: float = STOP_DECELERATION) -> None:
        """Stop the program and the arm, its fastest joint with this deceleration [rad/s^2]."""
        with self.lock:
            self._runner = None
            self.motion.stop(deceleration)
            self.runtime = RuntimeState.STOPPING

    def protective_stop(self, reason: str) -> None:
        """Stop the arm and lock it until `unlock`."""
        with self.lock:
            if self.protective:
                return
            self.protective, self._protective_since = True, self.now
            self.motion.stop(self.script.safety.deceleration)
            if self.runtime in (RuntimeState.PLAYING, RuntimeState.RESUMING):
                self.runtime = RuntimeState.PAUSING
            self.send_message(f"protective stop: {reason}")

    def unlock(self) -> bool:
        """Release a protective stop; returns False if that is not permitted yet."""
        with self.lock:
            if self.protective and self.now - self._protective_since < UNLOCK_AFTER:
                return False
            self.protective = False
            # An obstacle that keeps the arm off its target would stop it again: use its position as target.
            self.motion.target = np.vstack([self.arm.q, np.zeros((2, len(self.arm.q)))])
            self.motion.stop(STOP_DECELERATION)
            return True

    def run(self, program: Program) -> None:
        """Run a program from a client: a `def` or a single line replaces the running program, a `sec` runs in
        parallel to it. One with wrong arguments is not run."""
        with self.lock:
            if program.errors:
                for error in program.errors:
                    self.send_message(f"program {program.name}: not run: {error}")
                return
            for line in program.unknown:
                self.send_message(f"program {program.name}: the mock does not simulate `{line}`")
            runner = ProgramRunner(program, self)
            if program.kind == "sec":
                runner.step(STEP)
                return
            if program.kind == "line" and not program.statements:
                return
            if self.protective:
                self.send_message(f"program {program.name}: not run, the robot is in a protective stop")
                return
            if not runner.decelerates:
                # Also at rest, as in a dwell: otherwise the script's trajectory would go on after it.
                self.motion.stop(STOP_DECELERATION)
            self.motion.wanted = self.slider
            self._runner = runner
            self.runtime = RuntimeState.PLAYING
            self._watched_since = self.now

    def send_message(self, message: str) -> None:
        """Log a message and send it to all listeners."""
        self.log.append(message)
        for listener in self.on_message:
            listener(message)

    def _read(self) -> Reading:
        arm, cell = self.arm, self.cell
        joints = len(cell.robot.joints)
        noise = self._chance.standard_normal(12 + joints + 6 * len(cell.links))
        starts = range(12 + joints, len(noise), 6)
        loads = {
            sensor.name: sensor.map.reading(arm.link_wrench(sensor.link)) + sensor.noise * noise[at : at + 6]
            for at, sensor in zip(starts, cell.links, strict=True)
        }
        at_flange = arm.last_link_wrench if cell.tool is not None else np.zeros(6)
        gravity, friction = arm.gravity_torque, cell.friction(arm.qd, arm.gravity_torque)
        taken = friction + cell.drive.bias - (1.0 - cell.drive.gravity) * gravity
        alone = cell.drive.bias - arm.external_torque
        torque = arm.torque + taken if cell.drive.inertia else alone
        last = len(cell.robot.links) - 1
        return Reading(
            t=self.now,
            q=arm.q,
            qd=measured_velocity(arm.qd, self.script.noise.joint_velocity, self._chance),
            target=arm.target,
            torque=cell.torque_sign * (torque + cell.torque_noise * noise[12 : 12 + joints]),
            model_torque=cell.torque_sign * (arm.model_torque + taken),
            external_torque=arm.external_torque,
            base=cell.base.reading(arm.base_wrench) + cell.base_noise * noise[:6],
            wrist=cell.wrist.reading(at_flange) + cell.wrist_noise * noise[6:12],
            links=loads,
            external=arm.external_wrench,
            rotations=arm.rotations,
            origins=arm.origins,
            twist=arm.twist(last),
            runtime=self.runtime,
            protective=self.protective,
            speed=self.motion.fraction,
            slider=self.slider,
            deviation=self.deviation,
            collision=self.collision,
        )


def _check_start(arm: ArmSimulation, script: Script, cell: Cell) -> None:
    for contact in arm.contacts:
        raise ScriptError(
            f"obstacles[{contact.obstacle}]: expected to be clear of the arm at the start, but "
            f"{cell.link_names[contact.link]} is {1e3 * contact.depth:.1f} mm deep in the "
            f"{script.obstacles[contact.obstacle].kind}"
        )
