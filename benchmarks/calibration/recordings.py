"""`contactsense bench recordings FOLDER`: calibration and free-motion residuals on real UR10e recordings.

The files are those of github shamilmamedov/dynamic_calibration: about 100 Hz, no header, columns time, q, qd,
motor current, and a last group that in collision_* is the authors' own estimate of the external torque.
"""

import gzip
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.benchmarks import options
from contactsense.benchmarks.calibration.friction_factor import MovingResiduals, moving_residuals
from contactsense.benchmarks.calibration.payload_strike import strike
from contactsense.calibration import Calibration, FreeMotion, Settings, SuspectedContact, calibrate
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.parameters import Group
from contactsense.calibration.residuals.recording_residuals import residuals, settled_samples
from contactsense.robots.tool import Tool
from contactsense.service.sensors.signal_mapping import torque_constants

IDENTIFICATION = (
    "ur-20_01_31-unload",
    "ur-20_02_05-20sec_8harm",
    "ur-20_02_10-30sec_12harm",
    "ur-20_02_19_15harm50sec",
)
JOINTWISE = tuple(f"jointwise-joint_{j}" for j in range(1, 7))
"""One joint at a time, up to hard stops; calibration has not seen them."""
LOADED = ("ur-20_01_31-load", "ur-20_02_19_15harm50secLoad")
"""With a payload at the flange, which is estimated from each file: it was mounted differently."""
FREE = ("validation-p1", "validation-p2", "validation-p9", "validation-ptp_10_points", "collision_free")
MOVING_FILES = ("validation-ptp_10_points", "collision_free")
"""Those of `FREE` in which the arm moves."""
TOUCHED = ("collision_forearm", "push_pose_1")
_GROUPS: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor", "load", "lubricant", "links")
_PAYLOAD = 3.0, 0.05
"""Where the estimate of a payload starts: mass [kg], height of its centre of mass above the flange [m]."""
_LARGEST = 1e6
"""Larger values are damaged [s, rad, rad/s, A]."""
_GROUP_TITLES = {
    "identification": "which calibration has seen",
    "jointwise": "one joint at a time, hard stops",
    "loaded": "payload estimated from the same file",
}
_PAUSE = 0.3
"""Alarms separated by less than this belong to one contact [s]."""


def read(path: Path, scene: Scene) -> tuple[FreeMotion, np.ndarray]:
    """One file: motion and torques, and its last group of columns, shape (N, n).

    Truncated and damaged lines are skipped: two files end in a truncated one, one begins with nine damaged.
    """
    with gzip.open(path, "rt") as lines:
        rows = [line.strip().split(",") for line in lines]
    table = np.array([row for row in rows if len(row) == len(rows[0])], dtype=float)
    table = table[np.abs(table).max(axis=1) < _LARGEST]
    table = table[np.diff(np.maximum.accumulate(table[:, 0]), prepend=-np.inf) > 0.0]
    torque = table[:, 13:19] * torque_constants(scene)
    return FreeMotion(table[:, 0], table[:, 1:7], table[:, 7:13], torque, None, path.name), table[:, 19:25]


def _uncalibrated() -> Scene:
    return Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))


def _calibrated(folder: Path, bandwidth: float | None = None) -> Calibration:
    scene = _uncalibrated()
    if bandwidth is not None:
        scene = scene.model_copy(update={"bandwidth": bandwidth})
    files = [read(folder / f"{name}.csv.gz", scene)[0] for name in IDENTIFICATION]
    return calibrate(scene, files, Settings(_GROUPS))


def calibrated_scene(folder: Path, bandwidth: float | None = None) -> Scene:
    """The arm with joint torques, calibrated on the identification files.

    Args:
        folder: Of the recordings.
        bandwidth: Cut-off frequency of the observer [Hz]; None: the scene's default.
    """
    return _calibrated(folder, bandwidth).scene


def measure(folder: Path) -> dict[str, Any]:
    """Calibrate on the identification files and measure the others."""
    scene = _uncalibrated()

    def file(name: str) -> tuple[FreeMotion, np.ndarray]:
        return read(folder / f"{name}.csv.gz", scene)

    found = _calibrated(folder)
    arm = CalibrationModel.of(found.scene)
    free: dict[str, Any] = {}
    for name in FREE:
        recording, authors_estimate = file(name)
        start = settled_samples(recording, scene.bandwidth)
        free[name] = _residual_statistics(residuals(arm, recording, scene.bandwidth)[start:, :6])
        energy, onsets = _stream_energies(found.scene, recording)
        free[name] |= {"energy": float(energy[start:].max()), "alarms": len(onsets)}
        if name.startswith("collision"):
            free[f"{name} (authors)"] = _residual_statistics(authors_estimate[start:])
    threshold = max(level["energy"] for level in free.values() if "energy" in level)
    touched = {}
    for name in TOUCHED:
        recording, _ = file(name)
        energy, onsets = _stream_energies(found.scene, recording)
        t = recording.t - recording.t[0]
        touched[name] = {"touches": _touches(t, energy, threshold), "onsets": _since(recording, onsets)}
    by_group: dict[str, dict[str, list[float]]] = {"identification": {}, "jointwise": {}, "loaded": {}}
    strikes: dict[str, list[dict[str, Any]]] = {}
    seconds = sum(_duration(file(name)[0]) for name in FREE)
    moving = {name: moving_residuals(found.scene, file(name)[0]) for name in MOVING_FILES}
    moving["jointwise, each joint in its own file"] = _own_joint(
        [moving_residuals(found.scene, file(name)[0]) for name in JOINTWISE]
    )
    for group, names in (("identification", IDENTIFICATION), ("jointwise", JOINTWISE), ("loaded", LOADED)):
        for name in names:
            recording, _ = file(name)
            own = _with_payload(found.scene, recording) if group == "loaded" else found.scene
            onsets = _since(recording, _stream_energies(own, recording)[1])
            by_group[group][name] = onsets
            if group == "loaded":
                strikes[name] = [strike(own, recording, t)._asdict() for t in onsets]
            seconds += _duration(recording)
    return {
        "free": free,
        "threshold": threshold,
        "touched": touched,
        **by_group,
        "moving": {
            name: {key: value.tolist() for key, value in r._asdict().items()} for name, r in moving.items()
        },
        "strikes": strikes,
        "free_seconds": seconds,
        "warnings": list(found.warnings),
    }


def _own_joint(of_files: Sequence[MovingResiduals]) -> MovingResiduals:
    """Of joint j what its own file j says."""
    return MovingResiduals(*(np.diagonal(np.array(values)) for values in zip(*of_files, strict=True)))


def _duration(recording: FreeMotion) -> float:
    return float(recording.t[-1] - recording.t[0])


def _with_payload(scene: Scene, recording: FreeMotion) -> Scene:
    """The scene with the payload at the flange that this recording shows."""
    unknown = Tool(name="payload", mass=_PAYLOAD[0], com=(0.0, 0.0, _PAYLOAD[1]))
    return calibrate(scene.model_copy(update={"tool": unknown}), [recording], Settings(("payload",))).scene


def left_out(folder: Path, names: Sequence[str]) -> dict[str, list[SuspectedContact]]:
    """Calibrate on each file alone: the stretches in which something seems to push on the arm."""
    scene = _uncalibrated()
    return {
        name: list(calibrate(scene, [read(folder / f"{name}.csv.gz", scene)[0]]).contacts) for name in names
    }


def _since(recording: FreeMotion, times: list[float]) -> list[float]:
    """Times relative to the start of a recording [s]."""
    return [float(t - recording.t[0]) for t in times]


def _residual_statistics(values: np.ndarray) -> dict[str, Any]:
    return {
        "rms": np.sqrt(np.mean(values**2, axis=0)).tolist(),
        "q999": np.quantile(np.abs(values), 0.999, axis=0).tolist(),
    }


def _stream_energies(scene: Scene, recording: FreeMotion) -> tuple[np.ndarray, list[float]]:
    """Process a recording as a live stream.

    Returns:
        At every sample the energy of the no-contact hypothesis that this sample and the one before exceed,
        as an onset takes two; and the times of onsets at the scene's false-alarm rate [s].
    """
    assert recording.torque is not None
    localizer, energy, onsets = Localizer(scene), np.zeros(len(recording.t)), []
    for i, t in enumerate(recording.t):
        estimate = localizer.step(Sample(float(t), recording.q[i], recording.qd[i], recording.torque[i]))
        energy[i] = localizer._buffers.state.no_contact_energy[0]
        onsets += [event.t for event in estimate.events if event.kind == "onset"]
    return np.minimum(energy, np.concatenate(([0.0], energy[:-1]))), onsets


def _touches(t: np.ndarray, energy: np.ndarray, threshold: float) -> list[dict[str, float]]:
    above = np.flatnonzero(energy > threshold)
    if not len(above):
        return []
    groups = np.split(above, np.flatnonzero(np.diff(t[above]) > _PAUSE) + 1)
    return [
        {"start": float(t[g[0]]), "stop": float(t[g[-1]]), "energy": float(energy[g].max())} for g in groups
    ]


def _print_left_out(folder: Path, as_json: bool) -> None:
    try:
        # The motion of the first joint alone, about the vertical, determines too few parameters.
        found = left_out(folder, IDENTIFICATION + JOINTWISE[1:] + FREE + TOUCHED)
    except FileNotFoundError as error:
        raise click.ClickException(f"{error.filename}: no such recording") from None
    if as_json:
        click.echo(json.dumps({name: [asdict(c) for c in stretches] for name, stretches in found.items()}))
        return
    for name, stretches in found.items():
        times = ", ".join(f"{contact.start:.2f} to {contact.stop:.2f} s" for contact in stretches)
        click.echo(f"{name}: {times or 'nothing left out'}")


def _moving_table(moving: dict[str, dict[str, list[float]]]) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("free motion", *(f"joint {j}" for j in range(1, 7))):
        table.add_column(heading, justify="left" if heading.startswith("free") else "right")
    for name, found in moving.items():
        columns = zip(found["calibrated"], found["estimated"], strict=True)
        table.add_row(name, *(f"{a:.2f} -> {b:.2f}" for a, b in columns))
        table.add_row("  stated", *(f"{std:.2f}" for std in found["stated"]))
        table.add_row("  factor at the end", *(f"{factor:.2f}" for factor in found["factor"]))
    return table


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--left-out", "alone", is_flag=True, help="Only calibrate on each file alone, and list what is left out."
)
@options.as_json
def recordings(folder: Path, alone: bool, as_json: bool) -> None:
    """Calibrate on the identification files in FOLDER, and print residuals of free motion and the touches
    that stand out from them."""
    if alone:
        _print_left_out(folder, as_json)
        return
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
        detection = (f"{level['energy']:.1f}", str(level["alarms"])) if "energy" in level else ("", "")
        table.add_row(name, *pairs, *detection)
    console = Console(width=150)
    console.print("RMS / 99.9 % of each joint's residual")
    console.print(table)
    console.print("RMS of the residual of a moving joint in a live stream [Nm]: friction as calibrated,")
    console.print("then with its factor estimated; and the standard deviation that the stream states")
    console.print(_moving_table(result["moving"]))
    for name, found in result["touched"].items():
        touches, onsets = found["touches"], found["onsets"]
        console.print(f"{name}: {len(touches)} touches above {result['threshold']:.1f}")
        console.print(f"  {len(onsets)} onsets in the stream: {', '.join(f'{t:.2f}' for t in onsets)} s")
        for touch in touches:
            console.print(f"  {touch['start']:6.2f} to {touch['stop']:6.2f} s, energy {touch['energy']:.0f}")
    for group, what in _GROUP_TITLES.items():
        for name, onsets in result[group].items():
            times = ", ".join(f"{t:.2f} s" for t in onsets) or "none"
            console.print(f"{name}, {what}: onsets: {times}")
    for found in result["strikes"].values():
        for hit in found:
            x, y, z = hit["force"]
            console.print(
                f"  onset at {hit['t']:.2f} s: force ({x:.0f}, {y:.0f}, {z:.0f}) N, "
                f"{hit['distance']:.2f} m from the flange, moment along it {hit['pitch']:.2f} m; "
                f"payload at a height of {hit['height']:.2f} m, lowest {hit['lowest']:.2f} m"
            )
    console.print(f"free motion in all: {result['free_seconds']:.0f} s")
