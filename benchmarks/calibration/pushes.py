"""`contactsense bench pushes`: calibration from motion in which somebody pushes on the arm."""

import json
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Column, Table

from contactsense import Scene
from contactsense.benchmarks.calibration.coverage import CENTER, GROUPS, draw
from contactsense.benchmarks.calibration.simulate import Push, simulate
from contactsense.calibration import (
    Calibration,
    CalibrationError,
    FreeMotion,
    Settings,
    SuspectedContact,
    calibrate,
)
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import value

FORCES = (10.0, 20.0, 40.0, 80.0)
"""Sizes of the pushes [N]."""
_RIPPLE = 0.01
"""Amplitude of a torque that varies with the joint's position, which no parameter describes, in units of the
joint's limit: an RMS of 0.7 %, as the UR10e of `contactsense bench recordings` has."""
SIZES = (0.02, 0.04, 0.06, 1.0)
"""Upper edges of the sizes by torque, in units of the joint's limit."""
_SECONDS, _RATE = 20.0, 250.0


@dataclass(frozen=True)
class Made:
    """One push."""

    force: float
    """[N]"""
    torque: float
    """Torque of the joint that it loads most, mean over the push, in units of that joint's limit."""
    found: bool
    """Whether a stretch that was left out overlaps it."""


@dataclass(frozen=True)
class Run:
    """One motion, calibrated without pushes, and with them left out and kept."""

    false_in_free: int
    """Stretches left out of the motion without pushes."""
    false_in_touched: int
    """Stretches left out of the motion with pushes that overlap none."""
    pushes: tuple[Made, ...]
    scores: dict[str, list[float]] | None
    """Errors in units of the standard deviation without pushes: `free`, `left_out`, `kept`; None if the
    motion was refused."""


def measure(seed: int, base_sensor: bool, touched: bool = True) -> Run:
    """Draw a scene, a motion and pushes, and calibrate.

    Args:
        seed: Of all random numbers.
        base_sensor: Whether there is a sensor under the base beside the joint torques.
        touched: Whether to calibrate with pushes, too.
    """
    rng = np.random.default_rng(seed)
    truth, gain, start = draw(rng)
    groups = GROUPS
    if not base_sensor:
        truth, start = (scene.model_copy(update={"base_wrench": None}) for scene in (truth, start))
        groups = tuple(group for group in GROUPS if group not in ("wrench_bias", "delay"))
    motion = FourierTrajectory.draw(
        np.random.default_rng(seed + 10_000), CENTER, np.full(6, 0.7), 8, _SECONDS
    )
    wave, phase = rng.uniform(3.0, 9.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    pushes = draw_pushes(rng)

    limits = np.array([joint.torque_limit for joint in truth.robot.joints])

    def recorded(which: tuple[Push, ...]) -> FreeMotion:
        made = simulate(truth, motion, seed, _RATE, gain, which)
        assert made.torque is not None
        return replace(made, torque=made.torque + _RIPPLE * limits * np.sin(wave * made.q + phase) / gain)

    settings = Settings(groups, widths=False)
    untouched = recorded(())
    free = calibrate(start, [untouched], settings)
    if not touched:
        return Run(len(free.contacts), 0, (), None)
    recording = recorded(pushes)
    sizes = [_torque(push, untouched, recording, limits / gain) for push in pushes]
    try:
        left_out = calibrate(start, [recording], settings)
    except CalibrationError:
        made = tuple(Made(_force(push), size, True) for push, size in zip(pushes, sizes, strict=True))
        return Run(len(free.contacts), 0, made, None)
    kept = calibrate(start, [recording], replace(settings, leave_out_contacts=False))
    contacts = left_out.contacts

    def overlap(push: Push, contact: SuspectedContact) -> bool:
        return contact.start < push.stop and push.start < contact.stop

    return Run(
        len(free.contacts),
        sum(not any(overlap(push, contact) for push in pushes) for contact in contacts),
        tuple(
            Made(_force(push), size, any(overlap(push, contact) for contact in contacts))
            for push, size in zip(pushes, sizes, strict=True)
        ),
        _scores(truth, gain, {"free": free, "left_out": left_out, "kept": kept}),
    )


def draw_pushes(rng: np.random.Generator) -> tuple[Push, ...]:
    """Pushes of 0.3 to 2 s on any link but the base, 1 to 5 s apart."""
    pushes: list[Push] = []
    t = 1.0
    while True:
        t += rng.uniform(1.0, 5.0)
        stop = t + rng.uniform(0.3, 2.0)
        if stop > _SECONDS - 1.0:
            return tuple(pushes)
        direction = rng.standard_normal(3)
        x, y, z = rng.choice(FORCES) * direction / np.linalg.norm(direction)
        a, b, c = rng.uniform(-0.1, 0.1, 3)
        pushes.append(Push(int(rng.integers(1, 7)), (a, b, c), (x, y, z), t, stop))
        t = stop


def _force(push: Push) -> float:
    return float(round(np.linalg.norm(push.force), 6))


def _torque(push: Push, untouched: FreeMotion, touched: FreeMotion, limits: np.ndarray) -> float:
    """`Made.torque` from the recordings of one motion, whose noise is the same; `limits`: in units of the
    recorded torque, shape (n,)."""
    assert untouched.torque is not None
    assert touched.torque is not None
    during = (touched.t >= push.start) & (touched.t < push.stop)
    added = np.abs(touched.torque[during] - untouched.torque[during])
    return float((added.mean(axis=0) / limits).max())


def _scores(truth: Scene, gain: np.ndarray, found: dict[str, Calibration]) -> dict[str, list[float]]:
    true = CalibrationModel.of(truth).with_values(gain=gain)
    std = {item.entry.name: item.std for item in found["free"].values if not item.kept}
    return {
        name: [
            (item.after - value(true, item.entry)) / std[item.entry.name]
            for item in calibration.values
            if item.entry.name in std
        ]
        for name, calibration in found.items()
    }


def summarize(runs: list[Run]) -> dict[str, Any]:
    """Counts, and the errors of all parameters: RMS and 95 % quantile of the absolute values."""
    judged = [run.scores for run in runs if run.scores is not None]
    errors = {
        name: np.abs(np.concatenate([scores[name] for scores in judged])) if judged else np.full(1, np.nan)
        for name in ("free", "left_out", "kept")
    }
    return {
        "runs": len(runs),
        "refused": sum(run.scores is None and bool(run.pushes) for run in runs),
        "false_in_free": sum(run.false_in_free for run in runs),
        "false_in_touched": sum(run.false_in_touched for run in runs),
        "pushes": {
            f"{force:g} N": [
                sum(push.found for run in runs for push in run.pushes if push.force == force),
                sum(push.force == force for run in runs for push in run.pushes),
            ]
            for force in FORCES
        },
        "pushes_by_torque": {
            f"{100.0 * low:g} to {100.0 * high:g} %": [
                sum(push.found for run in runs for push in run.pushes if low <= push.torque < high),
                sum(low <= push.torque < high for run in runs for push in run.pushes),
            ]
            for low, high in pairwise((0.0, *SIZES))
        },
        "error": {
            name: {"rms": float(np.sqrt(np.mean(e**2))), "q95": float(np.quantile(e, 0.95))}
            for name, e in errors.items()
        },
    }


@click.command("pushes")
@click.option(
    "--runs", type=click.IntRange(1), default=20, show_default=True, help="Simulated motions with pushes."
)
@click.option(
    "--free", type=click.IntRange(0), default=0, show_default=True, help="Further motions without pushes."
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def bench_pushes(runs: int, free: int, as_json: bool) -> None:
    """Calibrate simulated motions with and without pushes: which are found, and what they do to the
    parameters."""
    result = {}
    for sensors, base_sensor in (("base sensor and torques", True), ("torques", False)):
        seeds = track(
            range(runs + free), sensors, console=Console(stderr=True), transient=True, disable=as_json
        )
        result[sensors] = summarize([measure(seed, base_sensor, seed < runs) for seed in seeds])
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    columns = {sensors: _cells(summary) for sensors, summary in result.items()}
    table = Table("", *(Column(sensors, justify="right") for sensors in columns), box=box.SIMPLE_HEAD)
    for cells in zip(*(column.items() for column in columns.values()), strict=True):
        table.add_row(cells[0][0], *(text for _, text in cells))
    Console().print(table)
    click.echo("error: RMS / 95 % of all parameters' errors, in standard deviations without pushes")


def _cells(summary: dict[str, Any]) -> dict[str, str]:
    """Row -> text."""
    cells = {
        "motions without pushes": str(summary["runs"]),
        "stretches left out of them": str(summary["false_in_free"]),
    }
    for force, (found, made) in summary["pushes"].items():
        cells[f"pushes of {force} found"] = f"{found} of {made}"
    for size, (found, made) in summary["pushes_by_torque"].items():
        cells[f"{size} of a joint's limit"] = f"{found} of {made}"
    cells["other stretches left out"] = str(summary["false_in_touched"])
    cells["motions refused"] = str(summary["refused"])
    for name, text in (("free", "no pushes"), ("left_out", "pushes left out"), ("kept", "pushes kept")):
        error = summary["error"][name]
        cells[f"error, {text}"] = f"{error['rms']:.2f} / {error['q95']:.2f}"
    return cells
