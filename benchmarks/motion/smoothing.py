"""`contactsense bench smoothing FOLDER`: contacts on moving arms, the live answer at their end beside the
answer from all of their samples."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer, SampleBlock
from contactsense.benchmarks.accuracy.static_cases import COLUMNS, Noise
from contactsense.benchmarks.motion.command import MODELS, samples, scene_for
from contactsense.benchmarks.motion.score import FORCE
from contactsense.benchmarks.motion.streams import KINDS, SUITES, Stream, read
from contactsense.runtime.result_rows import LINK, POINT_BASE
from contactsense.scene import Scene
from contactsense.service.analysis.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.smoothing import ContactSmoother, SmoothedContact
from contactsense.service.analysis.summarize import Summarizer

CHI_SQUARE_90 = 6.251
"""90 % of squared Mahalanobis distances in three dimensions are below this."""


@dataclass
class Comparison:
    """Of contacts of one arm, suite, kind of motion, noise and model."""

    live: list[float] = field(default_factory=list)
    """Error of the last live answer of each contact [m]."""
    smoothed: list[float] = field(default_factory=list)
    """Error of the smoothed answer for the same sample [m]."""
    live_all: list[float] = field(default_factory=list)
    """Errors of all live answers [m]."""
    smoothed_all: list[float] = field(default_factory=list)
    """Errors of the smoothed answers for the same samples [m]."""
    predicted: list[float] = field(default_factory=list)
    """Root of the trace of its covariance [m]."""
    covered: list[bool] = field(default_factory=list)
    """Whether the truth is in its 90 % region."""
    link_live: list[bool] = field(default_factory=list)
    link_smoothed: list[bool] = field(default_factory=list)

    def add(
        self, history: ContactHistory, smoothed: SmoothedContact | None, stream: Stream, frames: Summarizer
    ) -> None:
        """Compare at the last sample that has a live answer and a true contact of at least `FORCE`."""
        at = history.row[history.sample]
        strong = np.flatnonzero(
            (stream.link[at] >= 0) & (np.linalg.norm(stream.wrench[at, :3], axis=1) >= FORCE)
        )
        if len(strong) == 0:
            return
        truth, links = stream.point_base[at], stream.link[at]
        live = np.linalg.norm(history.rows[:, POINT_BASE] - truth, axis=1)
        smooth, last = live.copy(), int(strong[-1])
        self.link_live.append(bool(history.rows[last, LINK] == links[last]))
        self.link_smoothed.append(self.link_live[-1])
        if smoothed is not None:
            link = smoothed.best.link
            self.link_smoothed[-1] = bool(link == links[last])
            for k in strong:
                origin, rotation = frames.link_pose(stream.q[at[k]], link)
                point, _, covariance = smoothed.at(float(stream.t[at[k]]))
                error = origin + rotation @ point - truth[k]
                smooth[k] = np.linalg.norm(error)
            covariance = rotation @ covariance @ rotation.T
            self.predicted.append(float(np.sqrt(np.trace(covariance))))
            self.covered.append(bool(error @ np.linalg.solve(covariance, error) <= CHI_SQUARE_90))
        self.live.append(float(live[last]))
        self.smoothed.append(float(smooth[last]))
        self.live_all += live[strong].tolist()
        self.smoothed_all += smooth[strong].tolist()

    def row(self) -> dict[str, Any]:
        """The numbers, errors in mm."""
        return {
            "contacts": len(self.live),
            "link_right_live": float(np.mean(self.link_live)),
            "link_right_smoothed": float(np.mean(self.link_smoothed)),
            "error_mm_live": _quantiles(self.live),
            "error_mm_smoothed": _quantiles(self.smoothed),
            "error_mm_live_all": _quantiles(self.live_all),
            "error_mm_smoothed_all": _quantiles(self.smoothed_all),
            "predicted_mm": float(1e3 * np.median(self.predicted)) if self.predicted else None,
            "covered_90": float(np.mean(self.covered)) if self.covered else None,
        }


def _quantiles(errors: list[float]) -> dict[str, float]:
    return {"median": 1e3 * float(np.median(errors)), "p95": 1e3 * float(np.quantile(errors, 0.95))}


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--robot", "names", multiple=True, default=("ur5e", "ur10e"), help="Arm; may be repeated.")
@click.option("--suite", "suites", multiple=True, type=click.Choice(SUITES), default=("motion",))
@click.option(
    "--level", "levels", multiple=True, type=click.IntRange(0, len(COLUMNS) - 1), default=(1, 2, 3),
    help="Noise column, 0 (none) to 3; may be repeated.",
)  # fmt: skip
@click.option("--model", type=click.Choice(list(MODELS)), default="exact", show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers for a program.")
def smoothing(
    folder: Path, names: tuple[str, ...], suites: tuple[str, ...], levels: tuple[int, ...], model: str,
    as_json: bool,
) -> None:  # fmt: skip
    """Compare the last live answer of each contact in FOLDER's ground truth with the smoothed one."""
    rounds = [
        (name, suite, COLUMNS[level], wrong)
        for wrong in MODELS[model]
        for name in names
        for suite in suites
        for level in levels
    ]
    results = []
    for name, suite, noise, wrong in track(
        rounds, description="smoothing", console=Console(stderr=True), transient=True
    ):
        results += measure(read(folder, name, suite), noise, wrong)
    if as_json:
        click.echo(json.dumps({"results": results}, indent=1))
        return
    table = Table(
        title="errors in mm: live / from all samples of the contact",
        caption="end: last answer of each contact; all: every sample with a live answer",
    )
    for heading in ("arm", "suite", "noise N", "model", "motion"):
        table.add_column(heading, no_wrap=True)
    for heading in ("contacts", "link %", "median, end", "p95, end", "median, all", "p95, all", "predicted",
                    "in 90 %"):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    for r in results:
        table.add_row(
            r["robot"], r["suite"], f"{r['noise']['force']:g}", "wrong" if r["wrong_model"] else "exact",
            r["kind"], str(r["contacts"]),
            f"{100 * r['link_right_live']:.0f} / {100 * r['link_right_smoothed']:.0f}",
            *(
                f"{r['error_mm_live' + which][q]:.2f} / {r['error_mm_smoothed' + which][q]:.2f}"
                for which in ("", "_all")
                for q in ("median", "p95")
            ),
            "." if r["predicted_mm"] is None else f"{r['predicted_mm']:.2f}",
            "." if r["covered_90"] is None else f"{100 * r['covered_90']:.0f} %",
        )  # fmt: skip
    Console(width=150).print(table)


def measure(streams: list[Stream], noise: Noise, wrong: bool) -> list[dict[str, Any]]:
    """One row per kind of motion, and one for all of them."""
    scene = scene_for(streams[0], noise, wrong)
    localizer, smoother, frames = Localizer(scene), ContactSmoother(scene), Summarizer(scene)
    found = {kind: Comparison() for kind in (*KINDS, "all")}
    for stream in streams:
        for history in _contacts(stream, scene, localizer, noise, wrong):
            smoothed = smoother.smooth(history)
            for kind in (stream.kind, "all"):
                found[kind].add(history, smoothed, stream, frames)
    return [
        {
            "robot": streams[0].robot,
            "suite": streams[0].suite,
            "kind": kind,
            "noise": noise._asdict(),
            "wrong_model": wrong,
            **comparison.row(),
        }
        for kind, comparison in found.items()
        if comparison.live
    ]


def _contacts(
    stream: Stream, scene: Scene, localizer: Localizer, noise: Noise, wrong: bool
) -> Iterator[ContactHistory]:
    each = list(samples(stream, noise, wrong))
    block = SampleBlock(
        stream.t,
        stream.q,
        stream.qd,
        np.array([sample.joint_torque for sample in each]),
        np.array([sample.base_wrench for sample in each]),
    )
    collector, at = ContactCollector(), 0
    for found in localizer.run_blocks([block]):
        part = slice(at, at + len(found))
        at = part.stop
        yield from collector.add(np.arange(part.start, part.stop), block[part], found)
    yield from collector.end()
