"""Compare our estimates with those of other methods: same arms, same samples, same noise, failures included.

Run: python -m contactsense.benchmarks.compare
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense.benchmarks import options
from contactsense.benchmarks.peers import PEERS
from contactsense.benchmarks.peers.cases import ROBOTS, TRUTH, Case, answer, errors, score, static_cases
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
    """One row of plain numbers per noise column and method; lengths in mm, infinite ones as None."""
    rows = slice(skip, skip + samples)
    for case in static_cases(robot, sensors=(sensors,), rows=rows, folder=folder):
        for method in methods(case):
            answers, seconds = answer(method, case)
            result = score(answers, case.points, seconds)
            yield {
                "robot": robot,
                "sensors": sensors,
                "noise": list(case.noise),
                "method": method.name,
                "link_right": result.link_right,
                "median_mm": _finite(1e3 * result.median),
                "p95_mm": _finite(1e3 * result.p95),
                "near": float((errors(answers, case.points) <= NEAR).mean()),
                "answered": result.answered,
                "microseconds": 1e6 * seconds,
            }


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None


def _table(rows: list[dict[str, Any]], title: str) -> Table:
    table = Table(title=title)
    table.add_column("noise N / Nm / Nm", no_wrap=True)
    table.add_column("method", no_wrap=True)
    for name in ("link right", "median mm", "95 % mm", f"within {1e3 * NEAR:g} mm", "us / answer"):
        table.add_column(name, justify="right")
    last = None
    for row in rows:
        noise = " / ".join(f"{level:g}" for level in row["noise"])
        if last not in (None, noise):
            table.add_section()
        table.add_row(
            "" if noise == last else noise,
            row["method"],
            f"{100 * row['link_right']:.1f} %",
            *("no answer" if row[key] is None else f"{row[key]:.1f}" for key in ("median_mm", "p95_mm")),
            f"{100 * row['near']:.1f} %",
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
        Console(width=128).print(_table(part, title))


if __name__ == "__main__":
    main()
