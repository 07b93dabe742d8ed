"""`contactsense bench tilt FOLDER`: static contacts where the surface is not as the primitives are.

At an edge, in a pocket or on a rib, the normal of the touched surface is that of no primitive near it. A
force that lies in the friction cone of the real surface may then be tangential to the primitive, or pull on
it, and no push on the primitive explains it.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.calibration import Share, Verdict, judge
from contactsense.benchmarks.static_truth.cases import COLUMNS, Detail, Noise, scene_of
from contactsense.benchmarks.static_truth.points import StaticPoints, read, read_arrays
from contactsense.benchmarks.truth_arms import name_of, static_arms
from contactsense.robots.link_poses import link_poses
from contactsense.robots.surface.union import nearest
from contactsense.scene_model.constants import build_constants

TILT_BINS = (0, 10, 20, 30, 45, 60, 180)
"""Edges of the bins of the angle between the real normal and the primitive's [deg]."""
FORCE_BINS = (0, 15, 30, 45, 60, 75, 90, 180)
"""Edges of the bins of the angle between the force and the primitive's inward normal [deg]; from 90 on the
force pulls."""


class Angles(NamedTuple):
    """How N contacts lie on the primitives of their scene [deg]."""

    tilt: np.ndarray
    """Between the real normal and that of the nearest primitive of the touched link, shape (N,)."""
    force: np.ndarray
    """Between the force and the inward normal of that primitive, shape (N,)."""


class Bin(NamedTuple):
    """The contacts whose angle is in one bin, at one level of noise."""

    angle: str
    """`tilt` or `force`."""
    low: int
    high: int
    """Edges of the bin [deg]."""
    noise: Noise
    contacts: int
    no_answer: int
    in_region: int
    """Contacts inside their region of 90 %; without an answer there is none."""


@click.command()
@options.truth_folder
@options.truth_robots
@click.option(
    "--sensors",
    type=click.Choice(["all", "base"]),
    default="all",
    show_default=True,
    help="What is measured.",
)
@options.fitted_detail
@options.as_json
def tilt(folder: Path, robots: tuple[str, ...], sensors: str, detail: Detail, as_json: bool) -> None:
    """Count the answers to the static contacts in FOLDER by how their place and force lie on the primitives.

    \b
    force  angle between the force and the inward normal of the primitive nearest to the touched place: the
           contacts without an answer
    tilt   angle between the real normal there and that of the primitive: the contacts in their region of
           90 %, with the 95 % interval of that share

    The arms' contacts are counted together. Noise: N, Nm, Nm.
    """
    names = static_arms(folder, robots)
    points = {name: read(folder, name) for name in names}
    parts = [angles(folder, points[name], detail) for name in names]
    joined = Angles(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    cases = [(noise, name) for noise in COLUMNS for name in names]
    verdicts: dict[Noise, list[Verdict | None]] = {noise: [] for noise in COLUMNS}
    for noise, name in track(cases, description="locating", console=Console(stderr=True), transient=True):
        verdicts[noise] += judge(points[name], noise, sensors, detail)
    found = [b for noise in COLUMNS for b in count(joined, verdicts[noise], noise)]
    arms = [name_of(name) for name in names]
    if as_json:
        plain = [b._asdict() | {"noise": b.noise._asdict()} for b in found]
        click.echo(json.dumps({"robots": arms, "sensors": sensors, "detail": detail, "results": plain}))
        return
    what = f"{', '.join(arms)}; sensors {sensors}, detail {detail}"
    console = Console(width=112)
    console.print(_table(found, "force", f"contacts without an answer, {what}", "force / deg"))
    console.print(_table(found, "tilt", f"contacts in their region of 90 %, {what}", "tilt / deg"))


def angles(folder: Path, points: StaticPoints, detail: Detail = "fine") -> Angles:
    """How the contacts of `static_points_ROBOT.npz` in `folder` lie on the primitives of their scene.

    Args:
        folder: Folder with the file: it has the contacts' forces and normals.
        points: Its contacts.
        detail: Which primitives.

    Raises:
        click.ClickException: as for `read`.
    """
    scene = scene_of(points, COLUMNS[0], detail=detail)
    surfaces = build_constants(scene).surfaces
    contact = read_arrays(folder, points.robot, ("c_link", "n_link", "f"))
    place, normal, force = contact["c_link"], contact["n_link"], contact["f"]
    rows = np.arange(len(points.q))
    rotation = link_poses(scene.robot, points.q)[rows, points.link, :3, :3]
    in_link = np.einsum("nji,nj->ni", rotation, force)
    primitive = np.array(
        [
            nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], tuple(c))[3]
            for link, c in zip(points.link, place, strict=True)
        ]
    )
    return Angles(_between(normal, primitive), _between(-in_link, primitive))


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between the rows of two arrays, shape (N,) [deg]."""
    sine, cosine = np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)
    degrees: np.ndarray = np.degrees(np.arctan2(sine, cosine))
    return degrees


def count(found: Angles, verdicts: list[Verdict | None], noise: Noise) -> list[Bin]:
    """Count answers and regions in all bins.

    Args:
        found: Angles of N contacts.
        verdicts: On their estimates, N; None without an answer.
        noise: That of the estimates.
    """
    answered = np.array([v is not None for v in verdicts])
    inside = np.array([v is not None and v.in_region for v in verdicts])
    bins = []
    for name, edges in (("force", FORCE_BINS), ("tilt", TILT_BINS)):
        # The last bin holds its upper edge.
        which = np.minimum(np.digitize(getattr(found, name), edges) - 1, len(edges) - 2)
        for k, (low, high) in enumerate(pairwise(edges)):
            rows = which == k
            counts = (int(x[rows].sum()) for x in (np.ones_like(rows), ~answered, inside))
            bins.append(Bin(name, low, high, noise, *counts))
    return bins


def _table(found: list[Bin], angle: str, title: str, heading: str) -> Table:
    """One row for each bin of an angle, one column for each level of noise."""
    table = Table(title=title)
    table.add_column(heading, no_wrap=True)
    table.add_column("contacts", justify="right", no_wrap=True)
    for noise in COLUMNS:
        table.add_column(str(noise), justify="right", no_wrap=True)
    chosen = [b for b in found if b.angle == angle]
    for low, high in dict.fromkeys((b.low, b.high) for b in chosen):
        row = [b for b in chosen if (b.low, b.high) == (low, high)]
        table.add_row(f"{low} to {high}", str(row[0].contacts), *(_cell(b) for b in row))
    return table


def _cell(b: Bin) -> str:
    if b.angle == "force":
        return str(b.no_answer)
    return str(Share.of(b.in_region, b.contacts)) if b.contacts else "-"
