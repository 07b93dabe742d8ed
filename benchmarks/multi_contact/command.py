"""The command `contactsense bench several`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import click
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from contactsense.benchmarks import options
from contactsense.benchmarks.multi_contact.measure import WITHIN, Scenario, localizer_for, measure
from contactsense.benchmarks.multi_contact.pairs import measure_pairs
from contactsense.benchmarks.multi_contact.stream import measure_stream
from contactsense.benchmarks.multi_contact.trials import Links
from contactsense.benchmarks.static_truth.cases import COLUMNS, Detail, Noise

SCENARIOS = (Scenario("one_by_one", 0.5), Scenario("one_by_one", None), Scenario("at_once", None))


@click.command()
@options.robots
@click.option(
    "--contacts", type=click.IntRange(1, 3), multiple=True, default=(1, 2, 3), help="May be repeated."
)
@options.trials(300)
@options.force("Size of each force [N].")
@click.option(
    "--links",
    type=click.Choice(get_args(Links)),
    default="different",
    show_default=True,
    help="All contacts on different links, or all on one.",
)
@click.option("--noise", type=float, nargs=3, help="One column only: N, Nm, Nm (base force, moment, torque).")
@click.option(
    "--truth",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Locate the pairs of motion_ROBOT.npz in this folder instead of constructed ones.",
)
@options.fitted_detail
@click.option(
    "--stream",
    "speeds",
    type=float,
    multiple=True,
    help="Two contacts in live streams instead, joints moving with up to this speed, rad/s; may be repeated.",
)
@options.as_json
def several(
    robots: tuple[str, ...],
    contacts: tuple[int, ...],
    trials: int,
    force: float,
    links: Links,
    noise: tuple[float, float, float] | None,
    truth: Path | None,
    detail: Detail,
    speeds: tuple[float, ...],
    as_json: bool,
) -> None:
    """Locate one to three simultaneous contacts, starting one by one or all at once.

    The ground truth is simulated on the primitives of the arms, so that the result does not depend on how
    well primitives fit the meshes. With --truth: MuJoCo's, on the meshes. One sample per estimate. With
    --stream: samples at 500 Hz in which the second contact starts and ends while the first acts.
    """
    columns = COLUMNS if noise is None else (Noise(*noise),)
    results: list[dict[str, Any]] = []
    kinds = [(robot, level, n) for robot in robots for level in columns for n in contacts]
    with Progress(console=Console(stderr=True), transient=True) as progress:
        if truth is not None:
            for robot in progress.track(robots, description="locating"):
                results += [
                    {"robot": robot, "noise": str(level)} | row
                    for level in columns
                    for row in measure_pairs(truth, robot, level, detail)
                ]
        elif speeds:
            streams = [(robot, level, speed) for robot in robots for level in columns for speed in speeds]
            task = progress.add_task("following", total=len(streams) * trials)
            for robot, level, speed in streams:
                row = measure_stream(
                    localizer_for(robot, level, contacts=2, detail=detail), level, trials, speed, force=force,
                    tick=lambda: progress.advance(task),
                )  # fmt: skip
                results.append({"robot": robot, "noise": str(level)} | row)
        else:
            task = progress.add_task("locating", total=len(kinds) * trials * len(SCENARIOS))
            for robot, level, count in kinds:
                localizer = localizer_for(robot, level, detail=detail)
                for scenario in SCENARIOS[:1] if count == 1 else SCENARIOS:
                    row = measure(
                        localizer, level, trials, count, scenario, force=force, links=links,
                        tick=lambda: progress.advance(task),
                    )  # fmt: skip
                    known = "" if count == 1 else _scenario_name(scenario)
                    results.append({"robot": robot, "noise": str(level), "arriving": known} | row)
    if as_json:
        click.echo(json.dumps(results, indent=1))
    elif speeds and truth is None:
        _print_streams(results, f"{force:g} N in the friction cone, different links")
    else:
        subtitle = (
            "pairs of the moving truth" if truth else f"{force:g} N in the friction cone, {links} links"
        )
        _print(results, subtitle)


_PAIRS = (
    "; in brackets: 95 % interval by bootstrap over the pairs; pairs left out, as both contacts start "
    "together or the first has no estimate: {}"
)


def _scenario_name(scenario: Scenario) -> str:
    if scenario.arrival == "at_once":
        return "at once"
    drift = scenario.drift
    return "one by one, forces free" if drift is None else f"one by one, forces +-{drift:g} N"


def _print(results: Sequence[dict[str, Any]], subtitle: str) -> None:
    of_pairs = all("pairs" in r for r in results)
    table = Table(
        title=f"several contacts: {subtitle}",
        caption=(
            f"found: contacts within {1e3 * WITHIN:g} mm; all: trials with all of them; counted: right "
            "number of contacts; median, 95 %, RMSE of the contacts in mm, RMSE without the missed ones; ms: "
            "time of the last answer"
        )
        + (_PAIRS.format(max(r["left_out"] for r in results)) if of_pairs else ""),
    )
    for name in ("arm", "noise N / Nm / Nm", "contacts", "arriving"):
        table.add_column(name, no_wrap=name != "contacts")
    if of_pairs:
        table.add_column("pairs", justify="right")
    for name in ("found", "all", "counted", "median", "95 %", "RMSE", "ms"):
        table.add_column(name, justify="right")
    for r in results:
        table.add_row(
            r["robot"],
            r["noise"],
            str(r["contacts"]),
            r["arriving"],
            *([str(r["pairs"])] if of_pairs else []),
            f"{100 * r['success']:.1f} %" + (_interval(r["success_interval"]) if of_pairs else ""),
            *(f"{100 * r[key]:.1f} %" for key in ("all", "counted")),
            *(_number(r[key]) for key in ("median_mm", "p95_mm", "rmse_mm")),
            f"{r['median_ms']:.1f}",
        )
    Console(width=150).print(table)


def _interval(bounds: tuple[float, float]) -> str:
    return f" ({100 * bounds[0]:.0f}-{100 * bounds[1]:.0f})"


def _print_streams(results: Sequence[dict[str, Any]], subtitle: str) -> None:
    table = Table(
        title=f"two contacts in a stream: {subtitle}",
        caption=(
            f"found: both within {1e3 * WITHIN:g} mm in the median; median, 95 %: the worse contact of a "
            "stream, mm; delay: from the second's onset, ms; false: several answered of one; back: the "
            "first right again after the second; ms: 99 % of the steps take less"
        ),
    )
    for name in ("arm", "noise N / Nm / Nm"):
        table.add_column(name, no_wrap=True)
    for name in ("rad/s", "streams", "found", "median", "95 %", "delay", "never", "false", "back", "ms"):
        table.add_column(name, justify="right")
    for r in results:
        table.add_row(
            r["robot"],
            r["noise"],
            f"{r['speed']:g}",
            str(r["streams"]),
            f"{100 * r['found']:.1f} %",
            *(_number(r[key]) for key in ("median_mm", "p95_mm", "delay_ms")),
            *(f"{100 * r[key]:.1f} %" for key in ("never", "false", "back")),
            f"{r['ms']:.1f}",
        )
    Console(width=130).print(table)


def _number(value: float | None) -> str:
    return "missed" if value is None or value == float("inf") else f"{value:.1f}"
