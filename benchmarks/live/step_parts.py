"""`python -m contactsense.benchmarks.live.step_parts`: where the time of a sample without contact goes.

Each part is timed alone: parts of Python by calling them, parts of the machine code by repeating them in a
compiled loop. The fastest of many repetitions counts; the reference is Pinocchio's RNEA called from Python.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import click
import numpy as np

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks.live.speed import yardstick
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.equations_of_motion import advance_base, advance_torques
from contactsense.residuals.observers import start_steps
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.detection import conclude, decide
from contactsense.runtime.no_contact_hypothesis import energy_without_contact
from contactsense.runtime.residual_update import follow_noise_and_timing
from contactsense.sensors.stream_state import (
    TORQUE,
    TORQUE_DIFFERENCE,
    Readings,
    register_sample,
    store_sample,
)
from contactsense.service.mock.script import Script
from contactsense.service.mock.simulated_arm import simulate

FIRST, LAST = 4500, 4700
"""Samples of the demonstration between two touches, when the start of the stream is no longer watched."""
LOOP, TURNS = 500, 20
"""Repetitions in a compiled loop, and of each measurement."""
REGISTER, KINEMATICS, STEPS, BASE_EQUATIONS, TORQUE_EQUATIONS, NOISE, ENERGY, DECISION = range(8)
COMPILED = (
    "store the readings, times and gaps of the sensors",
    "kinematics, momenta, weights",
    "observers: weights of the step",
    "observers: base wrench in the frames of all bodies",
    "observers: joint torques, and their difference to the base wrench",
    "noise and timing error of the sensors",
    "covariances and energy of the no-contact hypothesis",
    "the rest of the decision, and its conclusions",
)


@kernel
def _repeat(buffers: Buffers, part: int, times: int, bandwidth: float, readings: Readings, t: float) -> float:
    """Repeat one part of `contactsense.runtime.kernels.detect`."""
    constants, state = buffer_views(buffers)
    stream, observers, motion, total = state.stream, state.observers, state.motion, 0.0
    dt = stream.clock[0].step
    for _ in range(times):
        if part == REGISTER:
            t += dt
            store_sample(stream, readings)
            total += register_sample(stream, t, 3, bandwidth)
        elif part == KINEMATICS:
            kinematics_and_momenta(state.model, stream.q, stream.qd, constants.gravity, motion)
        elif part == STEPS:
            total += start_steps(observers, stream.steps, bandwidth)[0][1]
        elif part == BASE_EQUATIONS:
            step = (0.9, 0.05, 0.05, 0.0, 0.0, 60.0)
            advance_base(motion, state.unbiased_wrench, step, observers.base)
        elif part == TORQUE_EQUATIONS:
            step = (0.9, 0.05, 0.05, 0.0, 0.0, 60.0)
            advance_torques(
                state.model, state.torque_model, motion, (stream.qd, stream.torque, state.unbiased_wrench),
                (stream.steps[TORQUE], stream.steps[TORQUE_DIFFERENCE]), (step, step), observers,
                state.stream_unmodelled_std,
                state.bias_filter.friction_regressor,
            )  # fmt: skip
        elif part == NOISE:
            follow_noise_and_timing(constants, state, bandwidth)
        elif part == ENERGY:
            total += energy_without_contact(constants, state, True, True, 0, 0.1)
        else:
            decision = decide(constants, state, bandwidth)
            # No update is due in most samples.
            state.consistency.status[0].time_since_update = 0.0
            state.bias_filter.status[0].time_since_update = 0.0
            total += conclude(constants, state, 0, decision, bandwidth)
    return total


def measure() -> list[tuple[str, float]]:
    """Each part and its time [s]; first the reference and the whole step."""
    script = Script.demo()
    motion = simulate(script)
    localizer = Localizer(
        Scene(
            robot=script.robot,
            base_wrench=WrenchSensor(
                force_noise=script.noise.base_force, moment_noise=script.noise.base_moment
            ),
            joint_torque=JointTorqueSensor(noise=script.noise.joint_torque),
        )
    )
    samples = [
        Sample(float(motion.t[i]), motion.q[i], motion.qd[i], motion.joint_torque[i], motion.base_wrench[i])
        for i in range(LAST)
    ]
    quiet = samples[FIRST:]

    def stream() -> None:
        localizer.reset()
        for sample in samples[:FIRST]:
            localizer.step(sample)

    call = yardstick()
    rnea = min(_each(lambda _: call(), quiet) for _ in range(10 * TURNS))
    steps = []
    for _ in range(TURNS):
        stream()
        steps.append(_each(localizer.step, quiet))
    fields, process = localizer._fields, localizer._process
    rest = (localizer._arguments, localizer._skin, localizer._options)
    converted = [fields(sample) for sample in quiet]
    # A vector of the wrong size: the call returns at once.
    refused = [(t, bits, (np.zeros(1), *readings[1:])) for t, bits, readings in converted]
    found = [
        ("Pinocchio's RNEA, called from Python", rnea),
        ("step", min(steps)),
        ("Python: sample to arguments", min(_each(fields, quiet) for _ in range(TURNS))),
        (
            "Python: the estimate",
            min(_each(lambda s: localizer._no_contact(s.t, 1.0), quiet) for _ in range(10 * TURNS)),
        ),
        (
            "call: conversion of the arguments, views of the arrays",
            min(_each(lambda x: process(*rest, *x), refused) for _ in range(10 * TURNS)),
        ),
    ]
    t, _, readings = converted[-1]
    for part, name in enumerate(COMPILED):
        fastest = np.inf
        for _ in range(TURNS):
            stream()
            began = time.perf_counter()
            _repeat(rest[0], part, LOOP, localizer.scene.bandwidth, readings, t)
            fastest = min(fastest, time.perf_counter() - began)
        found.append((f"machine code: {name}", fastest / LOOP))
    energy, decision = len(found) - 2, len(found) - 1
    # The decision contains the noise and the energy.
    found[decision] = (
        found[decision][0], max(found[decision][1] - found[energy][1] - found[energy - 1][1], 0.0),
    )  # fmt: skip
    return found


def _each(call: Callable[..., object], items: Sequence[Any]) -> float:
    """Median time of one call, without that of the clock [s]."""
    clock = time.perf_counter
    times, idle = [], []
    for item in items:
        began = clock()
        call(item)
        times.append(clock() - began)
        began = clock()
        idle.append(clock() - began)
    return float(np.median(times) - np.median(idle))


@click.command()
def main() -> None:
    """Print the table."""
    found = measure()
    reference, whole = found[0][1], found[1][1]
    rest = whole - sum(seconds for _, seconds in found[2:])
    click.echo("| part of a step without contact | ns | multiple of RNEA |")
    click.echo("|---|---|---|")
    for name, seconds in (*found, ("the rest: Python between these parts", rest)):
        click.echo(f"| {name} | {1e9 * seconds:.0f} | {seconds / reference:.2f} |")


if __name__ == "__main__":
    main()
