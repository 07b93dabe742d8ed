"""`contactsense bench coverage`: coverage of the uncertainties that calibration states."""

import json
from collections import defaultdict
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import JointTorqueSensor, Scene, WrenchSensor, robots
from contactsense.benchmarks import options
from contactsense.benchmarks.calibration.simulate import simulate
from contactsense.calibration import Settings, calibrate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import Group, value
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction
from contactsense.service.cli.options.finite_range import FiniteRange

GROUPS: tuple[Group, ...] = ("payload", "bias", "coulomb", "viscous", "rotor", "gain", "wrench_bias", "delay")
_NORMAL_95 = 1.96
CENTER = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
_VELOCITY = 0.05


def measure(runs: int, seconds: float, rate: float, show: bool = False) -> dict[str, Any]:
    """Simulate recordings with drawn parameters, calibrate each, and count true values within the 95 %
    intervals."""
    hits: dict[str, list[bool]] = defaultdict(list)
    scores: dict[str, list[float]] = defaultdict(list)
    for seed in track(
        range(runs), "calibrating", console=Console(stderr=True), disable=not show, transient=True
    ):
        for group, score in scores_of(seed, seconds, rate):
            hits[group].append(abs(score) < _NORMAL_95)
            scores[group].append(score)
    everything = [hit for group in hits.values() for hit in group]
    return {
        "runs": runs,
        "covered": float(np.mean(everything)),
        "groups": {
            group: {
                "count": len(hits[group]),
                "covered": float(np.mean(hits[group])),
                "score_std": float(np.std(scores[group])),
            }
            for group in hits
        },
    }


def scores_of(seed: int, seconds: float, rate: float) -> list[tuple[Group, float]]:
    """One recording: group of each estimated parameter, and its error in units of the stated standard
    deviation."""
    truth, gain, start = draw(np.random.default_rng(seed))
    motion = FourierTrajectory.draw(np.random.default_rng(seed + 10_000), CENTER, np.full(6, 0.7), 8, seconds)
    recording = simulate(truth, motion, seed, rate, gain)
    found = calibrate(start, [recording], Settings(GROUPS, widths=False))
    true = CalibrationModel.of(truth).with_values(gain=gain)
    return [
        (item.entry.group, (item.after - value(true, item.entry)) / item.std)
        for item in found.values
        if not item.kept
    ]


def draw(rng: np.random.Generator) -> tuple[Scene, np.ndarray, Scene]:
    """The truth, its torque constants relative to the stated ones, and the scene given to calibration."""
    scale = np.array([8.0, 7.0, 4.0, 1.5, 1.2, 1.0])

    def uniform(low: float, high: float, size: np.ndarray = scale) -> tuple[float, ...]:
        return tuple(float(x) for x in size * rng.uniform(low, high, len(size)))

    torque = JointTorqueSensor(
        signal="actual_current",
        torque_constants=(10.0,) * 6,
        friction=Friction(coulomb=uniform(0.5, 1.5), viscous=uniform(0.5, 2.0), velocity=_VELOCITY),
        rotor_inertia=uniform(0.2, 0.5),
        bias=uniform(-0.1, 0.1),
        noise=uniform(0.1, 0.2),
    )
    base = WrenchSensor(
        bias=(*rng.normal(0.0, 15.0, 3), *rng.normal(0.0, 4.0, 3)),
        delay=float(rng.uniform(-0.004, 0.004)),
    )
    tool = Tool(mass=float(rng.uniform(0.5, 3.0)), com=tuple(rng.normal(0.0, 0.04, 3)))
    robot = robots.load("ur5e")
    truth = Scene(robot=robot, joint_torque=torque, base_wrench=base, tool=tool)
    start = Scene(
        robot=robot,
        joint_torque=JointTorqueSensor(
            signal="actual_current", torque_constants=(10.0,) * 6, friction=Friction(velocity=_VELOCITY)
        ),
    )
    return truth, 1.0 + 0.05 * rng.standard_normal(6), start


@click.command()
@click.option("--runs", type=click.IntRange(1), default=40, show_default=True, help="Simulated recordings.")
@click.option("--seconds", type=FiniteRange(4.0), default=20.0, show_default=True, help="Length of each [s].")
@click.option(
    "--rate",
    type=FiniteRange(0.0, min_open=True),
    default=250.0,
    show_default=True,
    help="Samples a second [Hz].",
)
@options.as_json
def coverage(runs: int, seconds: float, rate: float, as_json: bool) -> None:
    """Calibrate simulated recordings and count how many true values lie in the stated 95 % intervals."""
    result = measure(runs, seconds, rate, show=True)
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("parameters", "estimates", "in 95 % interval", "std of error / stated std"):
        table.add_column(heading, justify="left" if heading == "parameters" else "right")
    for group, row in result["groups"].items():
        table.add_row(group, str(row["count"]), f"{100 * row['covered']:.1f} %", f"{row['score_std']:.2f}")
    Console().print(table)
    click.echo(
        f"{100 * result['covered']:.1f} % of all true values within their 95 % interval, {runs} recordings"
    )
