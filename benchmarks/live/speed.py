"""`contactsense bench speed`: time per sample, as ratios to Pinocchio's RNEA called from Python in the same
run."""

import json
import time
from collections.abc import Callable

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks import options
from contactsense.robots.extras import install_command
from contactsense.runtime.parallel_batch import usable_cores
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate

LARGE_BATCH = 100_000
ROUNDS = 5
"""Number of alternating repetitions of each measurement and the reference; the median of all calls counts."""


@click.command()
@options.as_json
def speed(as_json: bool) -> None:
    """Time one sample through the localizer on the demonstration's contacts.

    The reference is Pinocchio's RNEA of a 6-joint arm, called from Python in alternation with the measured
    function: machines differ and are noisy, but ratios are comparable. Needs Pinocchio (PyPI: pin).
    """
    call = yardstick()
    script = Script.demo()
    motion = simulate(script)
    scene = Scene(
        robot=script.robot,
        base_wrench=WrenchSensor(force_noise=script.noise.base_force, moment_noise=script.noise.base_moment),
        joint_torque=JointTorqueSensor(noise=script.noise.joint_torque),
    )
    localizer = Localizer(scene)
    touched = np.zeros(len(motion.t), dtype=bool)
    for touch in motion.touches:
        touched[touch.first : touch.last] = True
    names = ("rnea", "step", "step without contact", "step in contact", "locate", "batch")
    times: dict[str, list[float]] = {name: [] for name in names}
    large, speedup = np.resize(np.flatnonzero(touched), LARGE_BATCH), []
    for _ in track(range(ROUNDS), description="timing", console=Console(stderr=True), transient=True):
        times["rnea"] += _each(call, 20_000)
        steps = _steps(localizer, motion)
        times["step"] += steps
        times["step without contact"] += [s for s, hit in zip(steps, touched, strict=True) if not hit]
        times["step in contact"] += [s for s, hit in zip(steps, touched, strict=True) if hit]
        times["locate"] += _locates(localizer, motion, np.flatnonzero(touched)[::5])
        one_core = _batch(localizer, motion, large, 1)
        times["batch"].append(one_core)
        speedup.append(one_core / _batch(localizer, motion, large, None))
    p50 = {name: float(np.median(values)) for name, values in times.items()}
    p99 = {name: float(np.quantile(values, 0.99)) for name, values in times.items()}
    result = {
        "microseconds_p50": {name: 1e6 * value for name, value in p50.items()},
        "microseconds_p99": {name: 1e6 * value for name, value in p99.items()},
        "multiple_of_rnea_p50": {name: value / p50["rnea"] for name, value in p50.items()},
        "batch_samples_per_second": 1.0 / p50["batch"],
        "cores": usable_cores(),
        "batch_speedup_on_all_cores": float(np.median(speedup)),
    }
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    table = Table(title="one sample on one core, in multiples of Pinocchio's RNEA called from Python")
    for column in ("what", "p50 [us]", "p99 [us]", "p50 / RNEA"):
        table.add_column(column, justify="left" if column == "what" else "right")
    for name in times:
        table.add_row(
            name, f"{1e6 * p50[name]:.2f}", f"{1e6 * p99[name]:.2f}", f"{p50[name] / p50['rnea']:.1f}"
        )
    console = Console(width=100)
    console.print(table)
    console.print(
        f"locate_batch, {LARGE_BATCH:,} samples: {1.0 / p50['batch']:,.0f} a second on one core, "
        f"{np.median(speedup):.2f} times as many on {usable_cores()}"
    )


def yardstick() -> Callable[[], object]:
    try:
        import pinocchio as pin
    except ImportError:
        raise click.ClickException(f"needs Pinocchio: {install_command('test')}") from None
    model = pin.buildSampleModelManipulator()
    data = model.createData()
    q = pin.randomConfiguration(model)
    v = np.ones(model.nv)
    return lambda: pin.rnea(model, data, q, v, v)


def _each(call: Callable[[], object], times: int) -> list[float]:
    clock = time.perf_counter
    result = []
    for _ in range(times):
        start = clock()
        call()
        result.append(clock() - start)
    return result


def _steps(localizer: Localizer, motion: Motion) -> list[float]:
    clock = time.perf_counter
    localizer.reset()
    result = []
    for t, q, qd, torque, wrench in zip(
        motion.t.tolist(), motion.q, motion.qd, motion.joint_torque, motion.base_wrench, strict=True
    ):
        sample = Sample(t, q, qd, torque, wrench)
        start = clock()
        localizer.step(sample)
        result.append(clock() - start)
    return result


def _locates(localizer: Localizer, motion: Motion, rows: np.ndarray) -> list[float]:
    clock = time.perf_counter
    result = []
    for q, torque, wrench in zip(
        motion.q[rows], motion.joint_torque[rows], motion.base_wrench[rows], strict=True
    ):
        start = clock()
        localizer.locate(q, base_wrench=wrench, joint_torque=torque, external=False)
        result.append(clock() - start)
    return result


def _batch(localizer: Localizer, motion: Motion, rows: np.ndarray, jobs: int | None) -> float:
    q, wrench, torque = motion.q[rows], motion.base_wrench[rows], motion.joint_torque[rows]
    start = time.perf_counter()
    localizer.locate_batch(q, base_wrench=wrench, joint_torque=torque, external=False, jobs=jobs)
    return (time.perf_counter() - start) / len(q)
