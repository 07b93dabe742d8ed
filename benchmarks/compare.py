"""Compare our estimates with those of other methods: same arms, same samples, same noise, failures included.

Run: python -m contactsense.benchmarks.compare
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binom

from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.calibration import Share
from contactsense.benchmarks.peers import PEERS
from contactsense.benchmarks.peers.cases import ROBOTS, TRUTH, Case, answer, errors, static_cases
from contactsense.benchmarks.peers.method import Located, Method

NEAR = 0.0225
"""An estimate within this distance of the truth counts as a hit, as in Han & Kim (2023) [m]."""
SENSORS = {"all": "base and torques", "torques": "torques alone"}


def methods(case: Case) -> Iterator[Method]:
    """Our method first, then the peers that use the case's sensors."""
    yield Located(case.scene)
    for peer in PEERS:
        if peer.sensors == case.sensors:
            yield peer.make(case.scene)


def compare(
    robot: str, sensors: str, samples: int, skip: int = 0, folder: Path = TRUTH
) -> Iterator[dict[str, Any]]:
    """One row of plain numbers per noise column and method; lengths in mm, infinite ones as None. Each figure
    is followed by the bounds of its 95 % interval."""
    rows = slice(skip, skip + samples)
    for case in static_cases(robot, sensors=(sensors,), rows=rows, folder=folder):
        for method in methods(case):
            answers, seconds = answer(method, case)
            distance = errors(answers, case.points)
            yield {
                "robot": robot,
                "sensors": sensors,
                "noise": list(case.noise),
                "method": method.name,
                "link_right": Share.of(int((answers.link == case.points.link).sum()), len(distance)),
                "median_mm": [_finite(1e3 * value) for value in quantile(distance, 0.5)],
                "p95_mm": [_finite(1e3 * value) for value in quantile(distance, 0.95)],
                "near": Share.of(int((distance <= NEAR).sum()), len(distance)),
                "answered": float((answers.link >= 0).mean()),
                "microseconds": 1e6 * seconds,
            }


def quantile(values: np.ndarray, probability: float) -> tuple[float, float, float]:
    """A quantile of values (N,) and the bounds of its 95 % interval, from the order of the values alone."""
    count, ordered = len(values), np.sort(values)
    below, above = (int(binom.ppf(tail, count, probability)) for tail in (0.025, 0.975))
    ranks = int(np.ceil(probability * (count - 1))), max(below - 1, 0), min(above, count - 1)
    middle, low, high = (float(ordered[rank]) for rank in ranks)
    return middle, low, high


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None


def _length(figures: list[float | None]) -> str:
    value, low, high = ("inf" if one is None else f"{one:.1f}" for one in figures)
    return f"{value} ({low}-{high})"


def _percent(share: Share) -> str:
    return str(share).removesuffix(" %")


def _table(rows: list[dict[str, Any]], title: str) -> Table:
    table = Table(title=title, caption="in brackets 95 % intervals; inf: no answer")
    table.add_column("noise N / Nm / Nm", no_wrap=True)
    table.add_column("method", no_wrap=True)
    for name in ("link right %", "median mm", "95 % mm", f"within {1e3 * NEAR:g} mm %", "us"):
        table.add_column(name, justify="right", no_wrap=True)
    last = None
    for row in rows:
        noise = " / ".join(f"{level:g}" for level in row["noise"])
        if last not in (None, noise):
            table.add_section()
        table.add_row(
            "" if noise == last else noise,
            row["method"],
            _percent(row["link_right"]),
            _length(row["median_mm"]),
            _length(row["p95_mm"]),
            _percent(row["near"]),
            f"{row['microseconds']:.0f}",
        )
        last = noise
    return table


@click.command()
@click.option("--robot", "robots", multiple=True, default=ROBOTS, help="Arm; may be repeated.")
@click.option(
    "--samples", default=1500, show_default=True, help="How many contacts of each arm's ground truth."
)
@click.option(
    "--skip", default=500, show_default=True, help="How many to leave out before: peers were tuned on these."
)
@click.option("--truth", type=options.FOLDER, default=TRUTH, help="Contacts.")
@options.as_json
def main(robots: tuple[str, ...], samples: int, skip: int, truth: Path, as_json: bool) -> None:
    """Compare methods on static ground truth."""
    jobs = [(robot, sensors) for robot in robots for sensors in SENSORS]
    rows = [
        list(compare(robot, sensors, samples, skip, truth))
        for robot, sensors in track(jobs, "comparing", console=Console(stderr=True), transient=True)
    ]
    if as_json:
        click.echo(json.dumps([row for part in rows for row in part], indent=1))
        return
    for (robot, sensors), part in zip(jobs, rows, strict=True):
        title = (
            f"{robot}, {SENSORS[sensors]}: {samples} static contacts after {skip}, no answer counting as far"
        )
        Console(width=150).print(_table(part, title))


if __name__ == "__main__":
    main()
