"""`contactsense bench pruning FOLDER`: what `touchable` saves, and touches on links that it leaves out."""

import json
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.static_truth.cases import COLUMNS, Noise, measured, scene_of
from contactsense.benchmarks.static_truth.points import HALVES, StaticPoints, read, select
from contactsense.benchmarks.truth_arms import name_of, static_arms

ROUNDS = 3
"""Both scenes answer each contact this many times in turn; the fastest answer counts."""
CERTAIN = 0.95
"""Probability from which a link that was not touched counts as misattributed."""


@click.command()
@options.truth_folder
@options.truth_robots
@click.option(
    "--keep",
    multiple=True,
    default=("forearm", "wrist_1", "wrist_2", "wrist_3"),
    show_default=True,
    help="Link that may be touched; may be repeated.",
)
@options.half
@options.as_json
def pruning(folder: Path, robots: tuple[str, ...], keep: tuple[str, ...], half: str, as_json: bool) -> None:
    """Locate the static contacts in FOLDER with all links touchable and with those of --keep.

    Time: of the pruned scene over that of the whole one, on the same contacts in turn. Misattributed: a
    touch on a link left out is called one on a kept link, with a probability above 0.95.
    """
    contacts = [select(read(folder, robot), HALVES[half]) for robot in static_arms(folder, robots)]
    cases = [(points, noise) for points in contacts for noise in COLUMNS]
    shown = track(cases, description="locating", console=Console(stderr=True), transient=True)
    results = [measure(points, noise, keep) for points, noise in shown]
    if as_json:
        click.echo(json.dumps({"keep": list(keep), "half": half, "results": results}, indent=1))
        return
    table = Table(title=f"touchable: {', '.join(keep)}")
    columns = (
        "arm",
        "noise",
        "time, kept",
        "time, left out",
        "right, all",
        "right, kept",
        "none",
        "misattributed",
    )
    for column in columns:
        table.add_column(column, justify="left" if column in ("arm", "noise") else "right")
    for row in results:
        shares = (row["right_of_all"], row["right_of_kept"], row["none_of_these"], row["misattributed"])
        table.add_row(
            row["robot"],
            row["noise"],
            *(f"{row[name]:.2f}" for name in ("time_kept", "time_left_out")),
            *(f"{100 * share:.1f} %" for share in shares),
        )
    Console(width=100).print(table)


def measure(points: StaticPoints, noise: Noise, keep: tuple[str, ...]) -> dict[str, Any]:
    """Times and answers on one arm at one level of noise, as plain numbers."""
    scene = scene_of(points, noise)
    unknown = set(keep) - set(scene.link_names)
    if unknown:
        raise click.ClickException(f"--keep {sorted(unknown)[0]}: {points.robot} has {scene.link_names}")
    whole, pruned = Localizer(scene), Localizer(scene.model_copy(update={"touchable": keep}))
    wrench, torque = measured(points, noise)
    assert wrench is not None
    assert torque is not None
    seconds = np.full((2, len(points.q)), np.inf)
    link, kept_link = np.empty(len(points.q), dtype=int), np.empty(len(points.q), dtype=int)
    probability, none = np.empty(len(points.q)), np.empty(len(points.q), dtype=bool)
    clock = time.perf_counter
    for i, q in enumerate(points.q):
        for _ in range(ROUNDS):
            begin = clock()
            one = whole.locate(q, base_wrench=wrench[i], joint_torque=torque[i], external=False)
            middle = clock()
            other = pruned.locate(q, base_wrench=wrench[i], joint_torque=torque[i], external=False)
            end = clock()
            seconds[:, i] = np.minimum(seconds[:, i], (middle - begin, end - middle))
        link[i], kept_link[i] = int(np.argmax(one.link_probability)), int(np.argmax(other.link_probability))
        probability[i] = other.link_probability.max()
        none[i] = 1.0 - other.link_probability.sum() > probability[i]
    kept = np.isin(points.link, [scene.link_names.index(name) for name in keep])
    ratio = seconds[1] / seconds[0]
    return {
        "robot": name_of(points.robot),
        "noise": str(noise),
        "kept": int(kept.sum()),
        "left_out": int((~kept).sum()),
        "time_kept": float(np.median(ratio[kept])),
        "time_left_out": float(np.median(ratio[~kept])),
        "right_of_all": float((link == points.link)[kept].mean()),
        "right_of_kept": float(((kept_link == points.link) & ~none)[kept].mean()),
        "none_of_these": float(none[~kept].mean()),
        "misattributed": float((probability > CERTAIN)[~kept].mean()),
    }
