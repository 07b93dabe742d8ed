"""`contactsense bench analyze`: speed of the analysis of recordings, compared with only reading the file."""

import json
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pyarrow.parquet as pa_parquet
from rich.console import Console
from rich.table import Table

from contactsense import Localizer, Scene
from contactsense.benchmarks import options
from contactsense.service.analysis import analyze as run
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from contactsense.service.recordings import read
from contactsense.service.recordings.export import write_columns

ROUNDS = 5
"""Number of repetitions of each measurement; the shortest processor time counts, because other work on the
machine can only add to it."""


@click.command("analyze")
@click.option(
    "--minutes", type=FiniteRange(0.5), default=5.0, show_default=True, help="Length of a file [min]."
)
@options.as_json
def analyze(minutes: float, as_json: bool) -> None:
    """Time the analysis of simulated recordings at 500 Hz on one core: one without contact, the demo's, with
    contacts for a third of the time, and one with a single contact that lasts nine tenths of the time."""
    script = Script.demo()
    first = script.contacts[0]
    held = first.model_copy(update={"start": 2.0, "duration": script.duration - 3.0})
    scene = Scene(robot="ur5e")
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, played in (
            ("free", script.model_copy(update={"contacts": ()})),
            ("demo", script),
            ("held", script.model_copy(update={"contacts": (held,)})),
        ):
            path = Path(folder) / f"{name}.parquet"
            _write(simulate(played), path, minutes)
            results[name] = _measure(path, scene)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    if as_json:
        click.echo(json.dumps({**results, "memory_mb": memory}, indent=1))
        return
    table = Table(title=f"analysis of {minutes:g} minutes at 500 Hz, one core")
    for heading in ("recording", "stage", "us a sample", "times real time", "times reading with pyarrow"):
        table.add_column(heading, justify="left" if heading in ("recording", "stage") else "right")
    for name in results:
        for stage, row in results[name].items():
            table.add_row(
                name, stage, f"{row['us']:.2f}", f"{row['real_time']:.0f}", f"{row['times_reading']:.1f}"
            )
    console = Console(width=110)
    console.print(table)
    console.print(f"largest memory of the process: {memory:.0f} MB")


def _write(motion: Motion, path: Path, minutes: float) -> None:
    rounds = max(1, round(60.0 * minutes * motion.rate / len(motion.t)))
    columns = {"timestamp": np.arange(rounds * len(motion.t)) / motion.rate}
    for name, values in (
        ("actual_q", motion.q), ("actual_qd", motion.qd), ("joint_torque", motion.joint_torque),
        ("base_wrench", motion.base_wrench),
    ):  # fmt: skip
        columns |= {f"{name}_{i}": np.tile(values[:, i], rounds) for i in range(values.shape[1])}
    write_columns(path, columns)


def _measure(path: Path, scene: Scene) -> dict[str, dict[str, float]]:
    recording = read(path, scene)
    localizer = Localizer(scene)
    stages: dict[str, Callable[[], object]] = {
        "read with pyarrow": lambda: pa_parquet.read_table(path, use_threads=False),
        "read": lambda: read(path, scene),
        "localize": lambda: [len(found) for found in localizer.run_blocks(recording.sample_blocks())],
        "analyze, live answers": lambda: run(recording, scene, smooth=False, localizer=localizer),
        "analyze": lambda: run(recording, scene, localizer=localizer),
        "read and analyze": lambda: run(path, scene, localizer=localizer),
    }
    shortest = {}
    for name, stage in stages.items():
        times = []
        for _ in range(1 if "free" not in path.name and name in ("analyze", "read and analyze") else ROUNDS):
            start = time.process_time()
            stage()
            times.append(time.process_time() - start)
        shortest[name] = min(times)
    return {
        name: {
            "us": 1e6 * seconds / len(recording),
            "real_time": recording.seconds / seconds,
            "times_reading": seconds / shortest["read with pyarrow"],
        }
        for name, seconds in shortest.items()
    }
