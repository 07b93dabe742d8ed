"""`python -m contactsense.benchmarks.live.search_parts FOLDER`: where the time of one answer goes: before the
search, along the line of action, over the surface; by sensors and noise."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.static_truth.cases import COLUMNS, SENSORS, Noise, measured, scene_of
from contactsense.benchmarks.static_truth.points import StaticPoints, read
from contactsense.benchmarks.truth_arms import static_arms
from contactsense.localization.line_accuracy import KNOWN, ROUGHLY_KNOWN, UNKNOWN, line_accuracy
from contactsense.robots.jit.kernel import kernel
from contactsense.runtime.buffers import Buffers, buffer_views
from contactsense.runtime.explanation import isolate_links
from contactsense.runtime.static_residuals import Measured, take_static_sample
from contactsense.sensors.usable_sensors import Usable

REPETITIONS = 5
"""The fastest of these counts: the others were interrupted more often."""


class Parts(NamedTuple):
    """Times of one sample in a batch on one core [us]."""

    robot: str
    sensors: str
    noise: Noise
    before: float
    """Kinematics, residuals and link hypotheses."""
    line_share: float
    """Share of the samples whose line of action is known."""
    rough_share: float
    """Share of those whose line of action is roughly known."""
    line: float
    """The search along a known line of action; NaN without such samples."""
    rough: float
    """The search if it is roughly known: along it, or over the surface if it may enter many primitives; NaN
    without such samples."""
    surface: float
    """The search over the surface if the line of action is not known; NaN without such samples."""
    total: float
    """Mean over all samples."""


@kernel
def _before_the_search(buffers: Buffers, measured: Measured, usable: Usable, accuracy: np.ndarray) -> None:
    """Everything before the search, for N samples; fills how accurately each line of action is known, see
    `contactsense.localization.line_accuracy`."""
    constants, state = buffer_views(buffers)
    q, torque, base_wrench, link_wrench = measured
    has_base, has_torque, link_sensors = usable
    for i in range(q.shape[0]):
        take_static_sample(constants, state, (q[i], torque[i], base_wrench[i], link_wrench[i]), False)
        isolate_links(constants, state, has_base, has_torque, link_sensors, 1.0)
        best = int(np.argmin(state.hypotheses.energy))
        accuracy[i] = UNKNOWN
        if has_base:
            accuracy[i] = line_accuracy(
                constants.touchable, constants.sensors.depth, state.motion, state.hypotheses, best
            )


def microseconds(call: Callable[[], object], samples: int) -> float:
    """Time of a call that answers this number of samples, per sample; NaN without samples [us]."""
    if samples == 0:
        return float("nan")
    call()
    times = []
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times) / samples


def measure(points: StaticPoints, noise: Noise, sensors: str) -> Parts:
    """The parts for all contacts of one arm."""
    localizer = Localizer(scene_of(points, noise, sensors))
    wrench, torque = measured(points, noise, sensors)
    samples, joints = points.q.shape
    has_base, has_torque = SENSORS[sensors]
    values = (
        points.q,
        np.zeros((samples, joints)) if torque is None else torque,
        np.zeros((samples, 6)) if wrench is None else wrench,
        np.zeros((samples, 0, 6)),
    )
    buffers, accuracy = localizer._buffers.arguments, np.empty(samples, np.int64)
    before = microseconds(
        lambda: _before_the_search(buffers, values, (has_base, has_torque, 0), accuracy), samples
    )
    groups = [accuracy == which for which in (KNOWN, ROUGHLY_KNOWN, UNKNOWN)]

    def searched(rows: np.ndarray) -> float:
        chosen = tuple(None if part is None else part[rows] for part in (wrench, torque))
        return microseconds(
            lambda: localizer.locate_batch(
                points.q[rows], base_wrench=chosen[0], joint_torque=chosen[1], external=False, jobs=1
            ),
            int(rows.sum()),
        )

    times, shares = [searched(rows) for rows in groups], [float(rows.mean()) for rows in groups]
    line, rough, surface = (one - before for one in times)
    total = float(np.nansum(np.multiply(shares, times)))
    return Parts(points.robot, sensors, noise, before, shares[0], shares[1], line, rough, surface, total)


def table(parts: list[Parts]) -> Table:
    """One row for each set of sensors and level of noise."""
    drawn = Table(title="one sample of a batch on one core / us")
    for name in ("arm", "sensors", "noise N / Nm / Nm"):
        drawn.add_column(name, no_wrap=True)
    for name in ("before the search", "line known / roughly", "known", "roughly", "unknown", "all samples"):
        drawn.add_column(name, justify="right")
    for p in parts:
        drawn.add_row(
            p.robot,
            p.sensors,
            str(p.noise),
            f"{p.before:.1f}",
            f"{100 * p.line_share:.0f} / {100 * p.rough_share:.0f} %",
            *("" if np.isnan(value) else f"{value:.1f}" for value in (p.line, p.rough, p.surface)),
            f"{p.total:.1f}",
        )
    return drawn


@click.command()
@options.truth_folder
@options.truth_robots
@options.as_json
def main(folder: Path, robots: tuple[str, ...], as_json: bool) -> None:
    """Where the time of one answer goes, on the static contacts in FOLDER (static_points_ROBOT.npz)."""
    contacts = [read(folder, robot) for robot in static_arms(folder, robots)]
    cases = [(points, sensors, noise) for points in contacts for sensors in SENSORS for noise in COLUMNS]
    parts = [
        measure(points, noise, sensors)
        for points, sensors, noise in track(cases, console=Console(stderr=True), transient=True)
    ]
    if as_json:
        plain: list[dict[str, Any]] = [{**p._asdict(), "noise": p.noise._asdict()} for p in parts]
        click.echo(json.dumps(plain, indent=1))
    else:
        Console(width=118).print(table(parts))


if __name__ == "__main__":
    main()
