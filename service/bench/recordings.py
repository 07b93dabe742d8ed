"""`contactsense bench recordings FOLDER`: calibration and free-motion residuals on real UR10e recordings.

The files are those of github shamilmamedov/dynamic_calibration: about 100 Hz, no header, columns time, q, qd,
motor current, and a last group that in collision_* is the authors' own estimate of the external torque.
"""

import gzip
import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.calibration import Settings, Stretch, calibrate
from contactsense.calibration.linearize import settled
from contactsense.calibration.parameters import Group
from contactsense.calibration.plant import Plant
from contactsense.calibration.residuals import residuals
from contactsense.health import NOTHING
from service.sensors.mapping import torque_constants

IDENTIFICATION = (
    "ur-20_01_31-unload",
    "ur-20_02_05-20sec_8harm",
    "ur-20_02_10-30sec_12harm",
    "ur-20_02_19_15harm50sec",
)
FREE = ("validation-p1", "validation-p2", "validation-p9", "validation-ptp_10_points", "collision_free")
TOUCHED = ("collision_forearm", "push_pose_1")
_GROUPS: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor", "load", "lubricant", "links")
_PAUSE = 0.3
"""Alarms closer together than this are one touch [s]."""


def read(path: Path, scene: Scene) -> tuple[Stretch, np.ndarray]:
    """One file: motion and torques, and its last group of columns, shape (N, n).

    Lines that are cut short are left out (two files end in one).
    """
    with gzip.open(path, "rt") as lines:
        rows = [line.strip().split(",") for line in lines]
    table = np.array([row for row in rows if len(row) == len(rows[0])], dtype=float)
    torque = table[:, 13:19] * torque_constants(scene)
    return Stretch(table[:, 0], table[:, 1:7], table[:, 7:13], torque, None, path.name), table[:, 19:25]


def measure(folder: Path) -> dict[str, Any]:
    """Calibrate on the identification files and measure the others."""
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))

    def file(name: str) -> tuple[Stretch, np.ndarray]:
        return read(folder / f"{name}.csv.gz", scene)

    found = calibrate(scene, [file(name)[0] for name in IDENTIFICATION], Settings(_GROUPS))
    plant = Plant.of(found.scene)
    free: dict[str, Any] = {}
    for name in FREE:
        stretch, theirs = file(name)
        start = settled(stretch, scene.bandwidth)
        free[name] = _level(residuals(plant, stretch, scene.bandwidth)[start:, :6])
        energy, onsets = _follow(found.scene, stretch)
        free[name] |= {"energy": float(energy[start:].max()), "alarms": len(onsets)}
        if name.startswith("collision"):
            free[f"{name} (authors)"] = _level(theirs[start:])
    threshold = max(level["energy"] for level in free.values() if "energy" in level)
    touched = {}
    for name in TOUCHED:
        stretch, _ = file(name)
        energy, onsets = _follow(found.scene, stretch)
        t = stretch.t - stretch.t[0]
        touched[name] = {"touches": _touches(t, energy, threshold), "onsets": _since(stretch, onsets)}
    used = {}
    for name in IDENTIFICATION:
        stretch, _ = file(name)
        used[name] = _since(stretch, _follow(found.scene, stretch)[1])
    return {
        "free": free,
        "threshold": threshold,
        "touched": touched,
        "identification": used,
        "warnings": list(found.warnings),
    }


def _since(stretch: Stretch, times: list[float]) -> list[float]:
    """Times from the start of a recording on [s]."""
    return [float(t - stretch.t[0]) for t in times]


def _level(values: np.ndarray) -> dict[str, Any]:
    return {
        "rms": np.sqrt(np.mean(values**2, axis=0)).tolist(),
        "q999": np.quantile(np.abs(values), 0.999, axis=0).tolist(),
    }


def _follow(scene: Scene, stretch: Stretch) -> tuple[np.ndarray, list[float]]:
    """A live stream over a recording: at every sample the energy of "nothing touches" that decides about a
    contact, and the times at which one began at the scene's rate of false alarms [s]."""
    assert stretch.torque is not None
    localizer, energy, onsets = Localizer(scene), np.zeros(len(stretch.t)), []
    for i, t in enumerate(stretch.t):
        estimate = localizer.step(Sample(float(t), stretch.q[i], stretch.qd[i], stretch.torque[i]))
        energy[i] = localizer._work.memory.fit[NOTHING]
        onsets += [event.t for event in estimate.events if event.kind == "onset"]
    return energy, onsets


def _touches(t: np.ndarray, energy: np.ndarray, threshold: float) -> list[dict[str, float]]:
    over = np.flatnonzero(energy > threshold)
    if not len(over):
        return []
    groups = np.split(over, np.flatnonzero(np.diff(t[over]) > _PAUSE) + 1)
    return [
        {"start": float(t[g[0]]), "stop": float(t[g[-1]]), "energy": float(energy[g].max())} for g in groups
    ]


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def recordings(folder: Path, as_json: bool) -> None:
    """Calibrate on the identification files in FOLDER, and print residuals of free motion and the touches
    that stand out from them."""
    with Console(stderr=True).status("calibrating and measuring: a minute or two"):
        try:
            result = measure(folder)
        except FileNotFoundError as error:
            raise click.ClickException(f"{error.filename}: no such recording") from None
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("free motion [Nm]", *(f"joint {j}" for j in range(1, 7)), "highest energy", "alarms"):
        table.add_column(heading, justify="left" if heading.startswith("free") else "right")
    for name, level in result["free"].items():
        pairs = [f"{a:.2f} / {b:.2f}" for a, b in zip(level["rms"], level["q999"], strict=True)]
        told = (f"{level['energy']:.1f}", str(level["alarms"])) if "energy" in level else ("", "")
        table.add_row(name, *pairs, *told)
    console = Console(width=150)
    console.print("RMS / 99.9 % of each joint's residual")
    console.print(table)
    for name, found in result["touched"].items():
        touches, onsets = found["touches"], found["onsets"]
        console.print(f"{name}: {len(touches)} touches above {result['threshold']:.1f}")
        console.print(f"  the stream itself says {len(onsets)}: {', '.join(f'{t:.2f}' for t in onsets)} s")
        for touch in touches:
            console.print(f"  {touch['start']:6.2f} to {touch['stop']:6.2f} s, energy {touch['energy']:.0f}")
    for name, onsets in result["identification"].items():
        times = ", ".join(f"{t:.2f} s" for t in onsets) or "none"
        console.print(f"{name}, which calibration has seen: onsets: {times}")
