"""`python -m benchmarks.speed_error`: time of one answer against its error, one mark per method and level of
detail; a table, and the picture docs/speed_error.png."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
import matplotlib as mpl
import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.cases import MESHES, ROBOTS, Case, answer, errors, static_cases
from benchmarks.method import Located, Method
from benchmarks.peers import PEERS
from benchmarks.posterior.dense import Dense, Geometry
from benchmarks.posterior.table import GEOMETRIES, Skins
from service.bench.static_cases import COLUMNS, Detail, Noise

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

PICTURE = Path(__file__).parents[1] / "docs" / "speed_error.png"
NOISES = (COLUMNS[0], COLUMNS[2])
DETAILS: tuple[Detail, ...] = ("coarse", "fine", "skin")
QUANTILES = (0.5, 0.75, 0.95)
FARTHEST = 3.0
"""Where an answer that is not there is drawn [m]."""
SKIPPED = 500
"""Contacts left out before those that count: others' methods were tuned on these."""
MARKS = "osDv^<>PXhpd*"


class Mark(NamedTuple):
    """One method on one arm at one level of noise."""

    method: str
    robot: str
    noise: Noise
    microseconds: float
    """Of one answer."""
    error: tuple[float, ...]
    """`QUANTILES` of the distance from the truth, infinite where so many have no answer [m]."""
    link_right: float

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; infinite ones as None."""
        plain = self._asdict()
        plain["noise"] = self.noise._asdict()
        plain["error"] = [value if np.isfinite(value) else None for value in self.error]
        return plain


def methods(case: Case, skins: Skins) -> Iterator[Method]:
    """All methods for a case with base sensor and torques, each made when its turn comes."""
    for detail in DETAILS:
        meshes = MESHES / case.points.robot if detail == "skin" else None
        yield Located(case.scene.model_copy(update={"detail": detail, "meshes": meshes}))
    for geometry, samples in skins.samples.items():
        yield Dense(case.scene, geometry, samples=samples)
    for peer in PEERS:
        if peer.sensors == case.sensors:
            yield peer.make(case.scene)


def mark(method: Method, case: Case) -> Mark:
    """Answer a case and take the time."""
    answers, seconds = answer(method, case)
    quantiles = np.quantile(errors(answers, case.points), QUANTILES, method="higher")
    return Mark(
        method=method.name,
        robot=case.points.robot,
        noise=case.noise,
        microseconds=1e6 * seconds,
        error=tuple(float(value) for value in quantiles),
        link_right=float((answers.link == case.points.link).mean()),
    )


def table(marks: Sequence[Mark], contacts: int) -> Table:
    """One line a mark."""
    drawn = Table(
        title=f"base sensor and torques, {contacts} static contacts an arm",
        caption="error: 50 / 75 / 95 % quantiles in mm, failures included",
    )
    for name in ("arm", "noise N / Nm / Nm", "method"):
        drawn.add_column(name, no_wrap=True)
    for name in ("us / answer", "error", "link right"):
        drawn.add_column(name, justify="right", no_wrap=True)
    for m in sorted(marks, key=lambda m: (m.robot, m.noise, m.microseconds)):
        drawn.add_row(
            m.robot,
            str(m.noise),
            m.method,
            f"{m.microseconds:.0f}",
            " / ".join(f"{1e3 * value:.1f}" if np.isfinite(value) else "none" for value in m.error),
            f"{100 * m.link_right:.1f} %",
        )
    return drawn


def draw(marks: Sequence[Mark], path: Path = PICTURE) -> None:
    """One panel an arm and level of noise: medians as full marks, 95 % quantiles as open ones."""
    robots = sorted({m.robot for m in marks})
    noises = sorted({m.noise for m in marks})
    names = list(dict.fromkeys(m.method for m in marks))
    figure, panels = plt.subplots(
        len(robots), len(noises), figsize=(11.0, 3.6 * len(robots)), sharex=True, sharey=True, squeeze=False
    )
    colors = plt.get_cmap("tab20")
    for row, robot in zip(panels, robots, strict=True):
        for axes, noise in zip(row, noises, strict=True):
            own = [m for m in marks if (m.robot, m.noise) == (robot, noise)]
            for m in own:
                k = names.index(m.method)
                _draw_mark(axes, m, MARKS[k % len(MARKS)], colors(k % 20))
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.grid(alpha=0.3)
            quiet = not any(noise)
            axes.set_title(f"{robot}, {'no noise' if quiet else f'noise {noise}'}")
    for axes in panels[-1]:
        axes.set_xlabel("time of one answer [us]")
    for row in panels:
        row[0].set_ylabel("error [mm]: median (full), 95 % (open)")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="center right", fontsize=8)
    figure.tight_layout(rect=(0.0, 0.0, 0.8, 1.0))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_mark(axes: Axes, m: Mark, marker: str, color: Any) -> None:
    low, high = (1e3 * min(value, FARTHEST) for value in (m.error[0], m.error[-1]))
    axes.plot([m.microseconds] * 2, [low, high], color=color, linewidth=1)
    axes.plot(m.microseconds, low, marker, color=color, label=m.method)
    axes.plot(m.microseconds, high, marker, color=color, fillstyle="none")


@click.command()
@click.option("--contacts", default=500, show_default=True, help="Contacts of each arm.")
@click.option("--robot", "robots", multiple=True, default=ROBOTS, help="Arm; may be repeated.")
@click.option(
    "--geometry",
    "geometries",
    type=click.Choice(list(GEOMETRIES)),
    multiple=True,
    default=GEOMETRIES,
    help="Surface that the dense posterior samples; may be repeated.  [default: both]",
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def main(contacts: int, robots: tuple[str, ...], geometries: tuple[Geometry, ...], as_json: bool) -> None:
    """Time against error of all methods, and the picture docs/speed_error.png."""
    marks: list[Mark] = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("comparing", total=None)
        for robot in robots:
            skins = Skins.of(robot, "fine", MESHES, geometries)
            for case in static_cases(robot, NOISES, ["all"], rows=slice(SKIPPED, SKIPPED + contacts)):
                for method in methods(case, skins):
                    marks.append(mark(method, case))
                    progress.advance(task)
    draw(marks)
    if as_json:
        click.echo(json.dumps([m.as_json() for m in marks], indent=1))
    else:
        Console(width=128).print(table(marks, contacts))


if __name__ == "__main__":
    main()
