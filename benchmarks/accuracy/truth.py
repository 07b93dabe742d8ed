"""`contactsense bench truth FOLDER`: accuracy of links and contact points on simulated ground truth, with and
without noise."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.static_truth.cases import COLUMNS, SENSORS, Detail, Noise, measured, scene_of
from contactsense.benchmarks.static_truth.points import StaticPoints, read
from contactsense.benchmarks.truth_arms import name_of, static_arms
from contactsense.output.batch import Batch
from contactsense.static_localizer import Method

LISTED_WITHIN = 0.02
"""Distance from a reported candidate within which the truth counts as listed [m]."""


@click.command()
@options.truth_folder
@options.truth_robots
@click.option(
    "--method",
    type=click.Choice(get_args(Method)),
    default="joint",
    show_default=True,
    help="joint: link and place together; torques_first: the link from the torques, then the place on it; "
    "intrinsic: likewise, the place by the closed form.",
)
@click.option(
    "--sensors", type=click.Choice(list(SENSORS)), default="all", show_default=True, help="What is measured."
)
@options.detail
@options.meshes
@click.option("--brief", is_flag=True, help="Leave the confusion of links out of the table.")
@options.as_json
def truth(
    folder: Path,
    robots: tuple[str, ...],
    method: Method,
    sensors: str,
    detail: Detail,
    meshes: Path | None,
    brief: bool,
    as_json: bool,
) -> None:
    """Locate the static ground-truth contacts in FOLDER (static_points_ROBOT.npz).

    Every sample counts: one without an answer has an infinite error.
    """
    if detail == "skin" and meshes is None:
        raise click.UsageError("--detail skin needs --meshes")
    cases = [(read(folder, robot), noise) for robot in static_arms(folder, robots) for noise in COLUMNS]
    results = [
        measure(points, noise, method, sensors, detail, meshes)
        for points, noise in track(
            cases, description="locating", console=Console(stderr=True), transient=True
        )
    ]
    if as_json:
        click.echo(
            json.dumps({"method": method, "sensors": sensors, "detail": detail, "results": results}, indent=1)
        )
    else:
        _print_table(results, f"method {method}, sensors {sensors}, detail {detail}")
        if not brief:
            _print_confusion(results)


def measure(
    points: StaticPoints,
    noise: Noise,
    method: Method = "joint",
    sensors: str = "all",
    detail: Detail = "fine",
    meshes: Path | None = None,
) -> dict[str, Any]:
    """Locate all points with that noise added to base wrench and torques.

    Returns:
        Plain numbers for a table or JSON; errors in mm, infinite ones as None.
    """
    scene = scene_of(points, noise, sensors, detail, meshes)
    localizer = Localizer(scene, method)
    wrench, torque = measured(points, noise, sensors)

    def locate(rows: slice) -> Batch:
        return localizer.locate_batch(
            points.q[rows],
            base_wrench=None if wrench is None else wrench[rows],
            joint_torque=None if torque is None else torque[rows],
            external=False,
            detect=False,  # much noise on a weak joint may be beyond what it can bear
            jobs=1,
        )

    locate(slice(1))  # compiles or loads kernels, which the time must not contain
    start = time.perf_counter()
    batch = locate(slice(None))
    seconds = time.perf_counter() - start
    right = batch.link == points.link
    error = np.linalg.norm(batch.point_base - points.point_base, axis=1) * 1e3
    error[batch.link < 0] = np.inf
    links = len(scene.link_names)
    confusion = np.zeros((links, links + 1), dtype=int)
    np.add.at(confusion, (points.link, batch.link), 1)  # no answer: -1, the last column
    return {
        "robot": name_of(points.robot),
        "noise": noise._asdict(),
        "samples": len(right),
        "link_right": float(right.mean()),
        "error_mm": error_quantiles(error),
        "error_mm_link_right": error_quantiles(error[right]),
        "error_mm_clear": error_quantiles(error[batch.probability >= scene.clear]),
        "listed": _listed(localizer, points, wrench, torque),
        "microseconds_per_sample": 1e6 * seconds / len(right),
        "ambiguous": float((batch.probability < scene.clear).mean()),
        "undetected": float((~batch.detected).mean()),
        "no_answer": float((batch.link < 0).mean()),
        "links": list(scene.link_names),
        "confusion": confusion.tolist(),
    }


def _listed(
    localizer: Localizer, points: StaticPoints, wrench: np.ndarray | None, torque: np.ndarray | None
) -> float:
    """Share of the samples whose truth is among the reported explanations: right link, within
    `LISTED_WITHIN`."""
    hits = 0
    for i, (q, link, point) in enumerate(zip(points.q, points.link, points.point_base, strict=True)):
        estimate = localizer.locate(
            q,
            base_wrench=None if wrench is None else wrench[i],
            joint_torque=None if torque is None else torque[i],
            external=False,
            detect=False,
        )
        hits += any(
            contact.link_index == link and np.linalg.norm(contact.point_base - point) <= LISTED_WITHIN
            for contact in estimate.contacts
        )
    return hits / len(points.q)


def error_quantiles(error: np.ndarray) -> dict[str, float | None]:
    """Median and 95 % quantile; None if infinite, or of no values."""
    if len(error) == 0:
        return {"median": None, "p95": None}
    values = np.quantile(error, [0.5, 0.95], method="higher")
    return {
        name: float(v) if np.isfinite(v) else None for name, v in zip(("median", "p95"), values, strict=True)
    }


def _print_table(results: Sequence[dict[str, Any]], what: str) -> None:
    table = Table(
        title=f"static contacts, {what}; errors in mm, failures included",
        caption=(
            "clear: answers that are not ambiguous; listed: the truth is among the explanations, right link "
            f"and within {1e3 * LISTED_WITHIN:.0f} mm; us: time of one sample in a batch"
        ),
    )
    table.add_column("arm")
    table.add_column("noise N / Nm / Nm", no_wrap=True)
    for name in (
        "link right",
        "median",
        "p95",
        "clear: median",
        "p95",
        "ambiguous",
        "listed",
        "no answer",
        "us",
    ):
        table.add_column(name, justify="right")
    for r in results:
        table.add_row(
            r["robot"],
            " / ".join(f"{level:g}" for level in r["noise"].values()),
            f"{100 * r['link_right']:.1f} %",
            *(_mm(r[key][q]) for key in ("error_mm", "error_mm_clear") for q in ("median", "p95")),
            *(f"{100 * r[key]:.1f} %" for key in ("ambiguous", "listed", "no_answer")),
            f"{r['microseconds_per_sample']:.0f}",
        )
    _console().print(table)


def _print_confusion(results: Sequence[dict[str, Any]]) -> None:
    for r in results:
        levels = " / ".join(f"{level:g}" for level in r["noise"].values())
        confusion = Table(
            title=f"{r['robot']}, noise {levels}: links found (columns) for each link touched (rows)"
        )
        confusion.add_column("touched")
        for name in (*r["links"], "none"):
            confusion.add_column(name, justify="right")
        for name, row in zip(r["links"], r["confusion"], strict=True):
            confusion.add_row(name, *(str(count) if count else "." for count in row))
        _console().print(confusion)


def _console() -> Console:
    return Console(width=118)


def _mm(value: float | None) -> str:
    return "no answer" if value is None else f"{value:.2f}"
