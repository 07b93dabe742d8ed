"""`contactsense bench smoothing FOLDER`: contacts on moving arms: the live answer at their end compared with
the answer from all of their samples and with the limits given by the readings."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest

from contactsense import Localizer, SampleBlock
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.calibration import REGION
from contactsense.benchmarks.accuracy.truth import error_quantiles
from contactsense.benchmarks.motion import options as motion_options
from contactsense.benchmarks.motion.command import samples, scene_for
from contactsense.benchmarks.motion.options import MODELS
from contactsense.benchmarks.motion.score import FORCE
from contactsense.benchmarks.motion.smoothing_limit import smoothing_limit, true_path
from contactsense.benchmarks.motion.streams import Stream, read, redrawn
from contactsense.benchmarks.static_truth.cases import COLUMNS, Noise
from contactsense.benchmarks.statistics.credible_regions import level, mixture
from contactsense.benchmarks.truth_arms import files_of
from contactsense.runtime.result_rows import LINK, POINT_BASE
from contactsense.scene import Scene
from contactsense.scene_model.constants import build_constants
from contactsense.service.analysis.samples.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.samples.contact_windows import contact_windows
from contactsense.service.analysis.smoothing.contact_smoothing import ContactSmoother
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact
from contactsense.service.analysis.summary.summarize import Summarizer

KINDS = ("hold", "slide", "impact", "press", "two at a time", "all")
"""Kinds of contacts; "all" excludes runs with two simultaneous contacts, for which the live answer is
kept."""
RESAMPLED = 1000
"""Random draws of contacts for the interval of a ratio."""


@dataclass(frozen=True)
class Comparison:
    """Comparison for one contact, at its last sample that has a live answer and a true force of at least
    `FORCE`."""

    event: tuple[int, int]
    """Run and number of the event: identical for the same contact with different noise."""
    kind: str
    """One of `KINDS`."""
    live: float
    """Error of the live answer [m]."""
    whole: float
    """Error of the answer from the whole contact; that of the live one if there is none [m]."""
    surface_limit: float
    """Error of the oracle of `contactsense.benchmarks.motion.smoothing_limit` that knows the surface as the
    scene does; infinite if two contacts act, if the contact is too short for windows or without a base
    sensor [m]."""
    limit: float
    """Error of the one that knows the real surface [m]."""
    live_all: list[float]
    """Errors of all live answers [m]."""
    whole_all: list[float]
    """Errors of the whole contact's answer for the same samples [m]."""
    live_right: bool
    """Whether the live answer has the correct link."""
    whole_right: bool
    """Whether the whole contact's answer does."""
    live_probability: float
    """Probability of the live answer's link."""
    whole_probability: float | None
    """Probability of the link in the whole contact's answer; None if the live answer is kept."""
    predicted: float | None
    """Square root of the trace of the whole contact's covariance [m]."""
    covered: bool | None
    """Whether the region of 90 % of all of its places holds the truth."""


class PlaceAt(NamedTuple):
    """A place at one time, in the frame of its link: what `contactsense.Contact` says of it."""

    link_index: int
    probability: float
    point_base: np.ndarray
    normal_base: np.ndarray
    covariance: np.ndarray


class Comparer:
    """Compares the contacts of one arm's streams."""

    def __init__(self, scene: Scene) -> None:
        """Prepare for `scene`."""
        self._smoother, self._frames = ContactSmoother(scene), Summarizer(scene)
        constants = build_constants(scene)
        self._surfaces, self._prior, self._bandwidth = constants.surfaces, constants.prior, scene.bandwidth
        # Torques alone do not determine each window's force, which the oracle takes as free.
        self._has_limit = scene.base_wrench is not None

    def compare(self, history: ContactHistory, stream: Stream) -> Comparison | None:
        """Compare one contact; None if nothing touched at a single place or the touch was too light."""
        at = history.row[history.sample]
        strong = np.flatnonzero(
            (stream.link[at] >= 0) & (np.linalg.norm(stream.wrench[at, :3], axis=1) >= FORCE)
        )
        if len(strong) == 0:
            return None
        truth, links, last = stream.point_base[at], stream.link[at], int(strong[-1])
        (event, kind), link = _event(stream, int(at[last])), int(links[last])
        live = np.linalg.norm(history.rows[:, POINT_BASE] - truth, axis=1)
        whole, right = live.copy(), bool(history.rows[last, LINK] == link)
        whole_right, probability, predicted, covered = right, None, None, None
        found = self._smoother.smooth(history)
        if found is not None:
            for k in strong:
                origin, rotation = self._frames.link_pose(stream.q[at[k]], found.best.link)
                (point,), _, (covariance,) = found.at(stream.t[at[k] : at[k] + 1])
                whole[k] = np.linalg.norm(origin + rotation @ point - truth[k])
            whole_right = found.best.link == link
            probability = float(found.link_probability[found.best.link])
            predicted = float(np.sqrt(np.trace(covariance)))
            origin, rotation = self._frames.link_pose(stream.q[at[last]], link)
            covered = in_region(found, float(stream.t[at[last]]), link, (truth[last] - origin) @ rotation)
        windows = contact_windows(history, self._bandwidth)
        limit = surface_limit = np.inf
        if windows is not None and kind != "two at a time" and self._has_limit:
            measured = self._smoother.measurement(history, windows, link)
            slides = kind in ("slide", "press")
            path = true_path(stream, history, measured, self._frames, int(at[last]), slides)
            limit = smoothing_limit(path, measured, self._prior).error
            surface_limit = smoothing_limit(path, measured, self._prior, self._surfaces, link).error
        return Comparison(
            (stream.run, event), kind, float(live[last]), float(whole[last]), surface_limit, limit,
            live[strong].tolist(), whole[strong].tolist(), right, whole_right,
            float(history.link_probability[last, int(history.rows[last, LINK])]),
            probability, predicted, covered,
        )  # fmt: skip


def in_region(found: SmoothedContact, t: float, link: int, place: np.ndarray) -> bool:
    """Whether the smallest region with 90 % of the probability of all places holds the true one at time t
    [s]; `place`: in the frame of its link, shape (3,) [m]."""
    time = np.array([t])
    # Places on other links do not overlap with it, so that each may be in the frame of its own link.
    stated = [
        PlaceAt(one.link, float(probability), *(values[0] for values in found.at(time, number)))
        for number, (one, probability) in enumerate(zip(found.places, found.probability, strict=True))
    ]
    return level(mixture(stated), link, place) < REGION


def summary(contacts: Sequence[Comparison]) -> dict[str, Any]:
    """Statistics of some contacts, errors in mm."""
    answered = [c for c in contacts if c.covered is not None]
    within = sum(bool(c.covered) for c in answered)
    interval = binomtest(within, len(answered)).proportion_ci(0.9, "wilson") if answered else None
    return {
        "contacts": len({c.event for c in contacts}),
        "answers": len(contacts),
        "kept_live": len(contacts) - len(answered),
        "link_right": {
            "live": float(np.mean([c.live_right for c in contacts])),
            "whole": float(np.mean([c.whole_right for c in contacts])),
        },
        "probability": {
            "live": float(np.mean([c.live_probability for c in contacts])),
            "whole": float(np.mean([c.whole_probability for c in answered])) if answered else None,
            "whole_right": float(np.mean([c.whole_right for c in answered])) if answered else None,
        },
        "end": {
            name: error_quantiles(1e3 * np.array([getattr(c, name) for c in contacts]))
            for name in ("live", "whole", "surface_limit", "limit")
        },
        "ratio": _ratio(contacts),
        "all_samples": {
            "live": error_quantiles(1e3 * np.array([e for c in contacts for e in c.live_all])),
            "whole": error_quantiles(1e3 * np.array([e for c in contacts for e in c.whole_all])),
        },
        "predicted_mm": 1e3 * float(np.median([c.predicted for c in answered])) if answered else None,
        "covered_90": within / len(answered) if answered else None,
        "covered_90_interval": [float(interval.low), float(interval.high)] if interval else None,
    }


def _ratio(contacts: Sequence[Comparison]) -> list[float]:
    """Ratio of the median errors at the end, whole contact to live answer: 5 %, best estimate, 95 %.

    Bootstrap over contacts, each with all of its noise draws.
    """
    events = sorted({c.event for c in contacts})
    of = [[c for c in contacts if c.event == event] for event in events]
    rng = np.random.default_rng(0)

    def ratio(chosen: Sequence[int]) -> float:
        drawn = [c for i in chosen for c in of[i]]
        return float(np.median([c.whole for c in drawn]) / np.median([c.live for c in drawn]))

    again = [ratio(rng.integers(0, len(of), len(of)).tolist()) for _ in range(RESAMPLED)]
    return [
        float(np.quantile(again, 0.05)), ratio(range(len(of))), float(np.quantile(again, 0.95))
    ]  # fmt: skip


def _event(stream: Stream, row: int) -> tuple[int, str]:
    """Index and kind of the contact that acts in a sample."""
    for number, event in enumerate(stream.events):
        if event.start <= row < event.stop:
            return number, "two at a time" if stream.multi else event.type
    raise AssertionError(f"nothing touches in sample {row}")


@click.command()
@options.truth_folder
@options.truth_robots
@motion_options.suites(("motion",))
@motion_options.levels((1, 2, 3))
@motion_options.model("exact")
@motion_options.draws(3)
@click.option("--torques-alone", is_flag=True, help="Without the base sensor.")
@click.option(
    "--meshes", type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder with a folder of visual meshes for each arm, LINK.ply: scenes with `detail: skin`.",
)  # fmt: skip
@options.as_json
def smoothing(
    folder: Path, robots: tuple[str, ...], suites: tuple[str, ...], levels: tuple[int, ...], model: str,
    draws: int, torques_alone: bool, meshes: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Compare the last live answer of each contact in FOLDER's ground truth with the whole contact's.

    The arms' contacts are counted together. The limits are errors of oracles that have the same readings and
    know everything but the place: the link, when the place moves, and the surface, as the scene knows it or
    as it is.
    """
    streams = {pair: read(folder, *pair) for pair in files_of(folder, robots, suites)}
    names = list(dict.fromkeys(name for name, _ in streams))
    rounds = [
        (suite, COLUMNS[level], wrong) for wrong in MODELS[model] for suite in suites for level in levels
    ]
    results = []
    for suite, noise, wrong in track(
        rounds, description="smoothing", console=Console(stderr=True), transient=True
    ):
        found: list[Comparison] = []
        for number, name in enumerate(n for n in names if (n, suite) in streams):
            found += [
                replace(c, event=(100 * number + c.event[0], c.event[1]))
                for c in measure(
                    streams[name, suite], noise, wrong, draws, torques_alone, meshes and meshes / name
                )
            ]
        for kind in KINDS:
            chosen = [c for c in found if c.kind == kind or (kind == "all" and c.kind != "two at a time")]
            if chosen:
                results.append(
                    {
                        "suite": suite,
                        "noise": noise._asdict(),
                        "wrong_model": wrong,
                        "kind": kind,
                        **summary(chosen),
                    }
                )
    if as_json:
        click.echo(json.dumps({"robots": names, "draws": draws, "results": results}, indent=1))
    else:
        _print_table(results, names)


def _print_table(results: Sequence[dict[str, Any]], names: Sequence[str]) -> None:
    table = Table(
        title=f"{', '.join(names)}; errors in mm: live / whole contact / limit with the scene's surface / "
        "limit with the real one",
        caption=(
            "answers: contacts x draws of noise, in brackets those that keep the live answer; P: mean "
            "probability of the link named; end: last live answer of each contact; ratio: of the medians, "
            "whole / live, with the 90 % interval of contacts drawn anew; all: every sample with a live "
            "answer; in 90 %: truth within the region of 90 % over all places, with its 90 % interval"
        ),
    )
    suites, models = len({r["suite"] for r in results}) > 1, len({r["wrong_model"] for r in results}) > 1
    for heading in (*["suite"] * suites, *["model"] * models, "noise", "contact"):
        table.add_column(heading, no_wrap=True)
    for heading in ("contacts", "answers", "link %", "P %", "median, end", "ratio", "p95, end", "median, all",
                    "in 90 %"):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    for r in results:
        end, every, p = r["end"], r["all_samples"], r["probability"]
        low, ratio, high = r["ratio"]
        covered, within = r["covered_90"], r["covered_90_interval"]
        table.add_row(
            *[r["suite"]] * suites,
            *["wrong" if r["wrong_model"] else "exact"] * models,
            f"{r['noise']['force']:g} N",
            r["kind"],
            str(r["contacts"]),
            f"{r['answers']} ({r['kept_live']})",
            f"{100 * r['link_right']['live']:.1f} / {100 * r['link_right']['whole']:.1f}",
            f"{100 * p['live']:.1f} / " + ("." if p["whole"] is None else f"{100 * p['whole']:.1f}"),
            " / ".join(_number(value["median"]) for value in end.values()),
            f"{ratio:.2f} ({low:.2f}-{high:.2f})",
            " / ".join(_number(value["p95"], 1) for value in end.values()),
            " / ".join(_number(value["median"]) for value in every.values()),
            "." if covered is None else
            f"{100 * covered:.0f} ({100 * within[0]:.0f}-{100 * within[1]:.0f})",
        )  # fmt: skip
    Console(width=210).print(table)


def _number(value: float | None, digits: int = 2) -> str:
    return "." if value is None else f"{value:.{digits}f}"


def measure(
    streams: Sequence[Stream],
    noise: Noise,
    wrong: bool,
    draws: int = 1,
    torques_alone: bool = False,
    meshes: Path | None = None,
) -> Iterator[Comparison]:
    """Compare all contacts of one arm's streams, each with `draws` draws of noise (one without noise).

    `torques_alone`: without the base sensor; `meshes`: folder of the arm's meshes for a scene with
    `detail: skin`.
    """
    changes: dict[str, Any] = {"base_wrench": None} if torques_alone else {}
    if meshes is not None:
        changes |= {"detail": "skin", "meshes": meshes}
    scene = scene_for(streams[0], noise, wrong).model_copy(update=changes)
    localizer, comparer = Localizer(scene), Comparer(scene)
    for draw in range(draws if any(noise) else 1):
        for stream in streams:
            drawn = redrawn(stream, draw)
            for history in _contacts(drawn, localizer, noise, wrong):
                comparison = comparer.compare(history, drawn)
                if comparison is not None:
                    yield comparison


def _contacts(stream: Stream, localizer: Localizer, noise: Noise, wrong: bool) -> Iterator[ContactHistory]:
    each = list(samples(stream, noise, wrong))
    block = SampleBlock(
        stream.t,
        stream.q,
        stream.qd,
        np.array([sample.joint_torque for sample in each]),
        None if localizer.scene.base_wrench is None else np.array([sample.base_wrench for sample in each]),
    )
    collector, at = ContactCollector(localizer.scene.bandwidth), 0
    for found in localizer.run_blocks([block]):
        part = slice(at, at + len(found))
        at = part.stop
        yield from collector.add(np.arange(part.start, part.stop), block[part], found)
    yield from collector.end()
