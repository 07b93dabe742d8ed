"""`contactsense bench fleet`: a simulated year of a fleet, and the cost of its analysis."""

import json
import resource
import shutil
import time
from pathlib import Path
from typing import Any

import click
import pyarrow as pa
import pyarrow.parquet as pa_parquet
from rich.console import Console
from rich.table import Table

from contactsense.benchmarks import options
from contactsense.benchmarks.fleet.dataset import make_recording, plan, write_scenes
from contactsense.benchmarks.fleet.score import score_contacts, score_drift
from contactsense.service.analysis.fleet.report import write_fleet_report
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.fleet.summary import FleetSummary
from contactsense.service.analysis.fleet.worker_pool import run_tasks
from contactsense.service.cli.options.finite_range import FiniteRange

MANY = 100_000
"""Number of recordings that the times are extrapolated to."""


@click.command("fleet")
@click.option(
    "--recordings", type=click.IntRange(1), default=1000, show_default=True, help="Number of recordings."
)
@click.option("--robots", type=click.IntRange(1), default=10, show_default=True, help="Number of robots.")
@click.option(
    "--seconds",
    type=FiniteRange(8.0),
    default=30.0,
    show_default=True,
    help="Length of each recording [s].",
)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True, help="Number of processes.")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path, file_okay=False),
    help="Folder for dataset and results; what is there of an earlier run is replaced.",
)  # fmt: skip
@options.as_json
def fleet(recordings: int, robots: int, seconds: float, workers: int, out: Path, as_json: bool) -> None:
    """Simulate a year of a fleet with the mock's physics at 500 Hz, analyse it, and compare the result with
    the ground truth.

    Half of the recordings have contacts; biases and friction drift; one in a hundred is broken. Then
    `contactsense analyze OUT/data --workers N` runs.
    """
    data, results = out / "data", out / "results"
    for folder in (data, results):
        shutil.rmtree(folder, ignore_errors=True)
    made, making = _make(data, recordings, robots, seconds, workers)
    results.mkdir(parents=True)
    pa_parquet.write_table(pa.Table.from_pylist(made), out / "truth.parquet")
    before, start = _processor_time(), time.perf_counter()
    summary = analyze_fleet((data,), None, results, workers=workers)
    write_fleet_report(summary, results)
    wall, used = time.perf_counter() - start, _processor_time() - before
    samples = sum(robot.samples for robot in summary.robots)
    found: dict[str, Any] = {
        "recordings": recordings,
        "skipped": summary.skipped,
        "hours": sum(robot.hours for robot in summary.robots),
        **score_contacts(made, summary.contacts),
        "expected_false_alarms": summary.expected_false_alarms,
        "drift": score_drift(summary),
        "making_s": making,
        "analysis_s": wall,
        "processor_s": used,
        "samples_per_second": samples / wall,
        "samples_per_processor_second": samples / used,
        "worker_mb": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0,
        "main_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "data_mb": _size(data) / 1e6,
        "results_mb": _size(results) / 1e6,
    }
    if as_json:
        click.echo(json.dumps(found, indent=1))
    else:
        _print(found, summary, workers)


def _make(
    data: Path, recordings: int, robots: int, seconds: float, workers: int
) -> tuple[list[dict[str, Any]], float]:
    """Generate the dataset; returns its contacts, and the time taken [s]."""
    start = time.perf_counter()
    write_scenes(data, robots)
    made: list[dict[str, Any]] = []
    for task, result in run_tasks(make_recording, plan(data, recordings, robots, seconds), workers):
        if isinstance(result, BaseException):
            raise click.ClickException(f"{task.name}: {result}")
        made += result
    return made, time.perf_counter() - start


def _processor_time() -> float:
    """Processor time of this process and of the workers that have exited [s]."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def _print(found: dict[str, Any], summary: FleetSummary, workers: int) -> None:
    console = Console(width=110)
    robots = Table(title=f"{found['recordings']} recordings, {found['hours']:.1f} h")
    headings = (
        "robot", "contacts", "false", "friction made", "error", "joint bias made", "error", "calibration",
    )  # fmt: skip
    for heading in headings:
        robots.add_column(heading, justify="left" if heading == "robot" else "right")
    for row in found["drift"]:
        robots.add_row(
            row["robot"],
            str(row["contacts"]),
            str(found["false_by_robot"].get(row["robot"], 0)),
            f"{row['coulomb_made']:.2f} Nm",
            f"{row['coulomb_error']:.2f} Nm",
            f"{row['joint_bias_made']:.2f} Nm",
            f"{row['joint_bias_error']:.2f} Nm",
            {True: "needed", False: "fits", None: "unknown"}[row["needs_calibration"]],
        )
    console.print(robots)
    console.print("Friction (Coulomb) and bias: drift over the year, root mean square over the joints.")
    place = "" if found["median_mm"] is None else (
        f"; place off by {found['median_mm']:.1f} mm (median), {found['p95_mm']:.1f} mm (95 %); "
        f"force by {100 * found['force_error']:.0f} % (median)"
    )  # fmt: skip
    more = MANY / found["recordings"]
    for line in (
        f"contacts: {found['made']} made, {found['found']} found, {found['false']} false "
        f"({found['expected_false_alarms']:.2g} expected from noise), {found['split']} counted twice",
        f"link right: {100 * found['link_right']:.1f} %{place}",
        f"skipped: {found['skipped']} broken files",
        f"making: {found['making_s']:.0f} s; analysis: {found['analysis_s']:.0f} s with {workers} workers, "
        f"{found['processor_s']:.0f} s of processor time",
        f"speed: {found['samples_per_second']:.0f} samples/s, "
        f"{found['samples_per_processor_second']:.0f} per second of processor time "
        f"({found['samples_per_processor_second'] / 500.0:.0f} times real time at 500 Hz)",
        f"memory: {found['worker_mb']:.0f} MB the largest worker, {found['main_mb']:.0f} MB the main process",
        f"size: {found['data_mb']:.0f} MB of recordings, {found['results_mb']:.1f} MB of results",
        f"{MANY} recordings would take {more * found['processor_s'] / 3600.0:.1f} h of processor time, "
        f"{more * found['analysis_s'] / 3600.0:.1f} h on this machine, "
        f"{more * found['data_mb'] / 1e6:.2f} TB of recordings, {more * found['results_mb'] / 1e3:.1f} GB of "
        "results",
    ):
        console.print(line, soft_wrap=True, highlight=False)
