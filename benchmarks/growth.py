"""`python -m contactsense.benchmarks.growth`: how the time of one answer grows with the number of primitives,
of links and of simultaneous contacts; a table, and the picture docs/growth.png.

The arms are chains of equal links with one capsule each, 1.2 m long in all. A capsule that is divided into
several is the same body, so that only the number of primitives differs.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import click
import matplotlib as mpl
import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.benchmarks import options
from contactsense.benchmarks.live.search_parts import microseconds
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.primitives import Capsule
from contactsense.robots.robot import Inertia, Joint, Link, Robot
from contactsense.service.drawing.figure_style import figure_style

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "growth.png"
NOISE = COLUMNS[2]
LENGTH, RADIUS = 1.2, 0.05
"""Length of all links together, and their radius [m]."""
LINKS = (3, 4, 6, 8, 12)
PIECES = (1, 2, 4, 8)
"""Capsules of each link."""
JOINTS = 6
"""Number of moving links where that is not what is varied."""
FORCE = 20.0
"""Of each contact [N]."""
CONTACTS = (1, 2, 3)
FITTED = ("primitives", "links")
"""Where a power is fitted. One contact has a search of its own, so that no power fits the contacts."""


class Point(NamedTuple):
    """One measurement."""

    varied: str
    """What is counted: primitives, links or contacts."""
    number: int
    microseconds: float
    """Time of one answer."""


def chain(links: int, pieces: int) -> Robot:
    """An arm of that many moving links, whose joint axes are along and across the links in turn; each link
    has this number of capsules in one line."""
    length = LENGTH / links
    inertia = Inertia(1.0, np.array([0.0, 0.0, 0.5 * length]), 0.01 * np.eye(3))
    base = Link("base", inertia, (Capsule(a=(0.0, 0.0, RADIUS), b=(0.0, 0.0, 0.1), radius=1.2 * RADIUS),))
    ends = np.linspace(0.0, length, pieces + 1)
    capsules = tuple(
        Capsule(a=(0.0, 0.0, a), b=(0.0, 0.0, b), radius=RADIUS)
        for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)
    )
    return Robot(
        "chain",
        (base, *(Link(f"link {k + 1}", inertia, capsules) for k in range(links))),
        tuple(
            Joint(
                f"joint {k + 1}",
                np.eye(3),
                np.array([0.0, 0.0, length if k else 0.1]),
                np.array([0.0, 1.0, 0.0] if k % 2 else [0.0, 0.0, 1.0]),
                (-3.0, 3.0),
                3.0,
                300.0,
            )
            for k in range(links)
        ),
    )


def touches(
    robot: Robot, samples: int, contacts: int, seed: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Postures (N, n) [rad], external base wrenches (N, 6) [N, Nm] and torques (N, n) [Nm], noise included,
    of that many simultaneous pushes on random places."""
    rng = np.random.default_rng(seed)
    n = len(robot.joints)
    model, motion = build_model(robot), empty_motion(n)
    q = rng.uniform(-1.5, 1.5, (samples, n))
    wrench = rng.standard_normal((samples, 6)) * np.repeat(NOISE[:2], 3)
    torque = rng.standard_normal((samples, n)) * NOISE.torque
    for i in range(samples):
        forward_kinematics(model, q[i], motion)
        for link in rng.choice(np.arange(1, n + 1), contacts, replace=False):
            angle, along = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.2, 0.8) * LENGTH / n
            normal = np.array([np.cos(angle), np.sin(angle), 0.0])
            force = motion.rotation[link] @ (-FORCE * normal + 0.1 * FORCE * rng.standard_normal(3))
            point = motion.origin[link] + motion.rotation[link] @ (
                RADIUS * normal + np.array([0.0, 0.0, along])
            )
            applied = np.hstack((force, np.cross(point, force)))
            wrench[i] += applied
            # A joint's actuator holds against what acts beyond it.
            torque[i, :link] -= motion.screw[:link] @ applied
    return q, wrench, torque


def _localizer(robot: Robot, contacts: int = 1) -> Localizer:
    return Localizer(
        Scene(
            robot=robot,
            base_wrench=WrenchSensor(force_noise=NOISE.force, moment_noise=NOISE.moment),
            joint_torque=JointTorqueSensor(noise=NOISE.torque),
            contacts=contacts,
        )
    )


def one_contact(robot: Robot, samples: int) -> float:
    """Time of one answer of a batch of single contacts [us]."""
    q, wrench, torque = touches(robot, samples, 1)
    localizer = _localizer(robot)
    return microseconds(
        lambda: localizer.locate_batch(q, base_wrench=wrench, joint_torque=torque, jobs=1), samples
    )


def several_contacts(robot: Robot, samples: int, contacts: int) -> float:
    """Time of one call of `locate` that looks for up to this number of contacts, all of which are present
    [us]."""
    q, wrench, torque = touches(robot, samples, contacts)
    localizer = _localizer(robot, max(CONTACTS))

    def locate() -> None:
        for i in range(samples):
            localizer.locate(q[i], base_wrench=wrench[i], joint_torque=torque[i], contacts=contacts)

    return microseconds(locate, samples)


def measure(samples: int) -> Iterator[Point]:
    """All measurements."""
    for pieces in PIECES:
        yield Point("primitives", 1 + pieces * JOINTS, one_contact(chain(JOINTS, pieces), samples))
    for links in LINKS:
        yield Point("links", links, one_contact(chain(links, 2), samples))
    for contacts in CONTACTS:
        yield Point("contacts", contacts, several_contacts(chain(JOINTS, 2), max(samples // 10, 1), contacts))


def slope(points: Sequence[Point]) -> tuple[float, float]:
    """Exponent and factor of the power of the count that fits the times best, in logarithms."""
    exponent, offset = np.polyfit(
        np.log([p.number for p in points]), np.log([p.microseconds for p in points]), 1
    )
    return float(exponent), float(np.exp(offset))


def table(series: dict[str, list[Point]]) -> Table:
    """One row per measurement."""
    drawn = Table(title=f"time of one answer, base sensor and torques, noise {NOISE}")
    for name in ("varied", "number", "us", "grows as"):
        drawn.add_column(name, justify="left" if name == "varied" else "right")
    for varied, points in series.items():
        for p in points:
            fitted = varied in FITTED and p is points[-1]
            growth = f"number^{slope(points)[0]:.2f}" if fitted else ""
            drawn.add_row(varied, str(p.number), f"{p.microseconds:.1f}", growth)
    return drawn


def draw(series: dict[str, list[Point]], path: Path = PICTURE) -> None:
    """One panel for each quantity that is varied, with the fitted power."""
    with figure_style():
        figure, panels = plt.subplots(1, len(series), figsize=(3.6 * len(series), 3.6), squeeze=False)
        for axes, (varied, points) in zip(panels[0], series.items(), strict=True):
            _panel(axes, varied, points)
        panels[0][0].set_ylabel("time of one answer / µs")
        figure.tight_layout()
        figure.savefig(path)
    plt.close(figure)


def _panel(axes: Axes, varied: str, points: Sequence[Point]) -> None:
    count = np.array([p.number for p in points], dtype=np.float64)
    if varied in FITTED:
        exponent, factor = slope(points)
        axes.plot(count, factor * count**exponent, color="C1", label=f"number$^{{{exponent:.2f}}}$")
        axes.legend()
    axes.plot(count, [p.microseconds for p in points], "o", color="C0")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(f"number of {varied}")
    axes.set_xticks(count.tolist(), [f"{value:g}" for value in count])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


@click.command()
@click.option("--samples", default=1000, show_default=True, help="Contacts of each arm.")
@click.option("--picture", default=PICTURE, type=click.Path(path_type=Path), help="Where it is drawn.")
@options.as_json
def main(samples: int, picture: Path, as_json: bool) -> None:
    """Growth of the time of one answer, and the picture docs/growth.png."""
    series: dict[str, list[Point]] = {}
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("measuring", total=len(PIECES) + len(LINKS) + len(CONTACTS))
        for point in measure(samples):
            series.setdefault(point.varied, []).append(point)
            progress.advance(task)
    draw(series, picture)
    if as_json:
        click.echo(json.dumps([p._asdict() for points in series.values() for p in points], indent=1))
    else:
        Console(width=100).print(table(series))


if __name__ == "__main__":
    main()
