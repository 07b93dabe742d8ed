"""`contactsense bench hold`: error against holding time, and the trace of a sliding contact."""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.hold.simulate import CASES, SLIDE, TIMES, Case, Finger, scene_of, stream
from contactsense.service.cli.options.picture_file import picture_file


@click.command()
@click.option("--runs", type=click.IntRange(1), default=20, show_default=True, help="Streams of each kind.")
@click.option("--picture", type=click.Path(path_type=Path), help="Draw both into this picture (PNG or SVG).")
@options.as_json
def hold(runs: int, picture: Path | None, as_json: bool) -> None:
    """Press a finger with 20 N against a UR5e's forearm for 4 s, and slide it along at 50 mm/s.

    The surface is exact, the noise 0.25 N, 0.05 Nm at the base and 1 Nm at the joints. Errors are root mean
    squares over the streams; the stated standard deviations are printed next to them.
    """
    if picture is not None:
        with picture_file(picture):  # before the work: what draws may not be installed
            from contactsense.benchmarks.hold.picture import draw
    console = Console(stderr=True)
    rounds = [(case, seed) for case in CASES for seed in range(runs)]
    finger, localizers = Finger(), {case.name: Localizer(scene_of(case)) for case in CASES}
    squares: dict[str, list[np.ndarray]] = {case.name: [] for case in CASES}
    for case, seed in track(rounds, "holding", console=console, transient=True):
        squares[case.name].append(held(localizers[case.name], case, finger, seed))
    found = {name: summary(np.array(rows)) for name, rows in squares.items()}
    trace = slid(Localizer(scene_of(SLIDE)), finger)
    results = {"times": TIMES, "held": found, "slide": slide_summary(trace)}
    if picture is not None:
        with picture_file(picture):
            draw(found, trace, picture)
    if as_json:
        click.echo(json.dumps(results, indent=1))
    else:
        _print(results, runs)


def held(localizer: Localizer, case: Case, finger: Finger, seed: int) -> np.ndarray:
    """Squared error and stated variance at `TIMES` in one stream, shape (len(TIMES), 2) [m^2]; NaN without an
    answer.

    The variance is that along the surface: the one across states how well the primitives fit, and here they
    are exact.
    """
    found = np.full((len(TIMES), 2), np.nan)
    localizer.reset()
    for sample, point, since in stream(case, finger, TIMES[-1] + 0.01, seed):
        estimate = localizer.step(sample)
        for row in np.flatnonzero(np.abs(np.array(TIMES) - since) < 1e-6):
            if estimate.contacts:
                best = estimate.contacts[0]
                across = best.normal_base @ best.covariance @ best.normal_base
                found[row] = np.sum((best.point_base - point) ** 2), np.trace(best.covariance) - across
    return found


def summary(squares: np.ndarray) -> dict[str, list[float]]:
    """Root mean square error and stated standard deviation along the surface at `TIMES`, in mm.

    Args:
        squares: Squared errors and variances of all streams, see `held`, shape (runs, len(TIMES), 2) [m^2].
    """
    rms = np.sqrt(np.mean(squares[..., 0], axis=0))
    stated = np.sqrt(np.mean(squares[..., 1], axis=0))
    return {"error_mm": (1e3 * rms).tolist(), "stated_mm": (1e3 * stated).tolist()}


def slid(localizer: Localizer, finger: Finger, seed: int = 0) -> np.ndarray:
    """A sliding contact: time since the touch [s], true and estimated distance along the forearm [m], error
    [m], whether its phase is `slide`; one row per sample with an answer, shape (N, 5)."""
    rows = []
    start = finger.at(0.0)[0]
    for sample, point, since in stream(SLIDE, finger, 2.5, seed):
        estimate = localizer.step(sample)
        if estimate.contacts and since > 0.0:
            best = estimate.contacts[0]
            way = SLIDE.slide * float(np.clip(since - 0.5, 0.0, 1.0))
            error = float(np.linalg.norm(best.point_base - point))
            rows.append((since, way, start[0] - best.point[0], error, best.phase == "slide"))
    return np.array(rows)


def slide_summary(trace: np.ndarray) -> dict[str, Any]:
    """Error while the contact slides and after it has come to rest, in mm, and the delay of both reports."""
    since, error, sliding = trace[:, 0], 1e3 * trace[:, 3], trace[:, 4] > 0.0
    moving, after = (since > 0.6) & (since < 1.5), since > 2.0
    first = np.flatnonzero(sliding)
    return {
        "median_mm": float(np.median(error[moving])),
        "p95_mm": float(np.quantile(error[moving], 0.95)),
        "at_rest_mm": float(np.median(error[after])),
        "said_after_s": float(since[first[0]] - 0.5) if len(first) else None,
        "over_after_s": float(since[first[-1]] - 1.5) if len(first) else None,
    }


def _print(results: dict[str, Any], runs: int) -> None:
    table = Table(title=f"error of a held contact in mm, {runs} streams (stated)", box=box.SIMPLE_HEAD)
    table.add_column("held for [s]")
    for time in TIMES:
        table.add_column(f"{time:g}", justify="right")
    for name, row in results["held"].items():
        pairs = zip(row["error_mm"], row["stated_mm"], strict=True)
        table.add_row(name, *(f"{error:.2f} ({stated:.2f})" for error, stated in pairs))
    console = Console(width=120)
    console.print(table)
    slide = results["slide"]
    console.print(
        f"slide at {1e3 * SLIDE.slide:g} mm/s: error {slide['median_mm']:.2f} mm median, "
        f"{slide['p95_mm']:.2f} mm p95; once at rest {slide['at_rest_mm']:.2f} mm; "
        f"reported {slide['said_after_s']:.2f} s after its start, "
        f"ended {slide['over_after_s']:.2f} s after its end"
    )
