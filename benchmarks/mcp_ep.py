"""The setting of MCP-EP (Han & Kim 2023), as far as it is known: up to three contacts, one after another.

Known: joint torques and a base sensor, 20 N, contacts on different links that start one at a time, and that
an answer counts as correct within 22.5 mm. Unknown, and assumed here: the arm is at rest, all moving links
are equally probable, places are uniform by area and lie on the primitives that the method is given, forces
are uniform within friction 0.5; and the noise.

Run: python -m contactsense.benchmarks.mcp_ep
"""

import json
import time
from collections.abc import Iterator
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.arms import arm
from contactsense.benchmarks.compare import NEAR
from contactsense.benchmarks.peers.exploration_filter import ExplorationFilter, Found
from contactsense.benchmarks.peers.one_by_one import OneByOne
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.benchmarks.static_truth.cases import ASSUMED, COLUMNS, Noise

REPORTED = ((99.96, 1.6), (96.70, 10.8), (81.63, 35.0))
"""Success [%] and RMSE [mm] in the paper for one, two and three contacts, on a Panda."""
CONTACTS = 3
HELD = 0.5
"""Standard deviation of the change of each component of the earlier forces when the next contact is added
[N]. In this setting they do not change; the paper's filter does not use that."""
DRAWS = 2000
"""Number of draws of the bootstrap."""
LOOSE = 2.0
"""The same in a live stream [N]:
`contactsense.multi_contact.tracking.multi_hypothesis_filter.FORCE_DRIFT`."""


class Judged(NamedTuple):
    """Estimates with this number of contacts present."""

    success: float
    """Fraction of the runs in which every contact is found within `NEAR`."""
    success_interval: tuple[float, float]
    """Its 95 % interval (Wilson)."""
    each: float
    """Fraction of the contacts found within `NEAR`."""
    rmse: float
    """Root mean square distance of the contacts with an answer, including failures [m]."""
    rmse_interval: tuple[float, float]
    """Its 95 % interval: bootstrap over the runs, whose contacts are not independent [m]."""


def scene_of(robot: str, noise: Noise) -> Scene:
    """The arm with both sensors and that noise; its base link cannot be touched.

    Args:
        robot: A name that `robots.load` knows, a path to a URDF with its `.surface.yaml` beside it, or panda.
        noise: Noise of one sample.
    """
    known = arm(robot)
    stated = Noise(*(max(level, floor) for level, floor in zip(noise, ASSUMED, strict=True)))
    return Scene(
        robot=known,
        touchable=known.link_names[1:],
        base_wrench=WrenchSensor(force_noise=stated.force, moment_noise=stated.moment),
        joint_torque=JointTorqueSensor(noise=stated.torque),
    )


def sequence(touches: Touches, noise: Noise, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Base wrenches and joint torques after each contact has been added, shapes (N, K, 6) and (N, K, n)."""
    rng = np.random.default_rng(seed)
    wrench, torque = np.cumsum(touches.base_wrench, axis=1), np.cumsum(touches.joint_torque, axis=1)
    return (
        wrench + rng.normal(size=wrench.shape) * np.repeat(noise[:2], 3),
        torque + rng.normal(size=torque.shape) * noise.torque,
    )


def judge(found: Found, touches: Touches) -> Iterator[Judged]:
    """Score after one, two, ... contacts; answers are matched such that the largest distance is as small as
    possible."""
    for t in range(found.link.shape[1]):
        matched = pair(found, touches, t)[0]
        all_found = (matched <= NEAR).all(axis=1)
        interval = binomtest(int(all_found.sum()), len(matched)).proportion_ci(method="wilson")
        rmse, rmse_interval = _root_mean_square(matched)
        yield Judged(
            success=float(all_found.mean()),
            success_interval=(float(interval.low), float(interval.high)),
            each=float((matched <= NEAR).mean()),
            rmse=rmse,
            rmse_interval=rmse_interval,
        )


def _root_mean_square(distance: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Root mean square of the finite ones of distances (N, K), and its 95 % bootstrap interval over rows;
    infinite where none is finite."""
    there = np.isfinite(distance)
    squares, counts = np.where(there, distance, 0.0) ** 2 @ np.ones(there.shape[1]), there.sum(axis=1)
    rows = np.random.default_rng(0).integers(len(counts), size=(DRAWS, len(counts)))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.sqrt(squares.sum() / counts.sum())
        drawn = np.sqrt(squares[rows].sum(axis=1) / counts[rows].sum(axis=1))
    low, high = np.quantile(np.nan_to_num(drawn, nan=np.inf), (0.025, 0.975), method="nearest")
    return (float(found) if there.any() else np.inf), (float(low), float(high))


def pair(found: Found, touches: Touches, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Assign an answer to each true contact such that the largest distance is as small as possible.

    Args:
        found: Answers.
        touches: The truth.
        step: Index of the measurement: there are `step` + 1 contacts.

    Returns:
        Distances, infinite for contacts without an answer, and whether the answer has the correct link,
        shapes (N, step + 1).
    """
    here = slice(step + 1)
    gap = np.linalg.norm(found.point_base[:, step, :, None] - touches.point_base[:, None, here], axis=-1)
    gap[found.link[:, step] < 0] = np.inf
    way = np.array([_way(of_run) for of_run in gap])
    links = np.take_along_axis(found.link[:, step], way, axis=1)
    distance = np.take_along_axis(gap, way[:, None], axis=1)[:, 0]
    return distance, links == touches.link[:, here]


def _way(gap: np.ndarray) -> tuple[int, ...]:
    """Index of the answer for each true contact; `gap`: distances of answers from contacts, shape (A, K)."""
    contacts = range(gap.shape[1])
    return min(
        permutations(range(len(gap)), gap.shape[1]),
        key=lambda way: sorted((gap[way[k], k] for k in contacts), reverse=True),
    )


class Row(NamedTuple):
    """One method on one arm with one noise level."""

    method: str
    judged: list[Judged]
    """Results after one, two, ... contacts."""
    seconds: list[float]
    """Time of an answer after each."""


def compare(robot: str, noise: Noise, runs: int, seed: int) -> Iterator[Row]:
    """Our method with fixed, loosely constrained and free forces; and the exploring particle filter."""
    scene = scene_of(robot, noise)
    touches = Toucher(scene, seed=seed).draw(runs, CONTACTS, even=True)
    measured = sequence(touches, noise, seed + 1)
    one = touches.q[:1], *(part[:1] for part in measured)
    for drift in (HELD, LOOSE, None):
        ours = OneByOne(scene, CONTACTS, drift)
        ours.follow(*one)
        found, seconds = ours.follow(touches.q, *measured)
        yield Row(ours.name, list(judge(found, touches)), list(seconds))
    method = ExplorationFilter(scene, contacts=CONTACTS)
    method.follow(*one)
    start = time.perf_counter()
    found = method.follow(touches.q, *measured)
    spent = (time.perf_counter() - start) / runs / CONTACTS
    yield Row(method.name, list(judge(found, touches)), [spent] * CONTACTS)


@click.command()
@click.option(
    "--robot", "names", multiple=True, default=("ur5e",), help="Arm by name, panda, or a URDF with a surface."
)
@click.option("--runs", default=150, show_default=True, help="Postures with three contacts each.")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the random numbers."
)
@click.option("--json", "as_json", is_flag=True, help="Plain numbers instead of tables.")
def main(names: tuple[str, ...], runs: int, seed: int, as_json: bool) -> None:
    """Print success and error for one, two and three contacts that are added one after another."""
    cases = [(name, noise) for name in names for noise in COLUMNS[:3]]
    results = [
        (Path(name).stem, noise, row)
        for name, noise in track(cases, "locating", console=Console(stderr=True), transient=True)
        for row in compare(name, noise, runs, seed)
    ]
    if as_json:
        plain = [
            {"robot": name, "noise": list(noise), "method": row.method, "contacts": k + 1}
            | judged._asdict()
            | {"seconds": row.seconds[k]}
            for name, noise, row in results
            for k, judged in enumerate(row.judged)
        ]
        click.echo(json.dumps(plain, indent=1))
        return
    for name in dict.fromkeys(name for name, _, _ in results):
        Console(width=145).print(_table(name, runs, [part[1:] for part in results if part[0] == name]))


def _table(name: str, runs: int, rows: list[tuple[Noise, Row]]) -> Table:
    title = f"{name}: contacts of 20 N one after another, {runs} runs; within {1e3 * NEAR:g} mm"
    table = Table(title=title, caption="in brackets 95 % intervals")
    table.add_column("noise N / Nm / Nm", no_wrap=True)
    table.add_column("method", no_wrap=True)
    for column in ("contacts", "all found %", "each found %", "RMSE mm", "ms an answer"):
        table.add_column(column, justify="right", no_wrap=True)
    for k, (success, rmse) in enumerate(REPORTED):
        head = ("not stated", "MCP-EP, its paper (Panda)") if k == 0 else ("", "")
        table.add_row(*head, f"{k + 1}", f"{success:.2f}", "", f"{rmse:.1f}", "8.2" if k == 0 else "")
    last = None
    for noise, row in rows:
        if noise != last:
            table.add_section()
        for k, judged in enumerate(row.judged):
            table.add_row(
                str(noise) if noise != last else "",
                row.method if k == 0 else "",
                f"{k + 1}",
                _with_interval(100, judged.success, judged.success_interval),
                f"{100 * judged.each:.1f}",
                _with_interval(1e3, judged.rmse, judged.rmse_interval),
                f"{1e3 * row.seconds[k]:.1f}",
            )
            last = noise
    return table


def _with_interval(scale: float, value: float, interval: tuple[float, float]) -> str:
    return f"{scale * value:.1f} ({scale * interval[0]:.1f}-{scale * interval[1]:.1f})"


if __name__ == "__main__":
    main()
