"""`contactsense bench touches FOLDER`: known touches in real free motion, torques alone.

The errors of a real arm's model are in its recordings of free motion. To the torques of such a recording
those of a known contact are added, s_j . w for every joint proximal to it: the observers are linear, so the
residuals are those of that contact on that arm, except that the arm does not yield. So the touched link is
known, and the probabilities that are stated under real model error can be tested.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Localizer, SampleBlock
from contactsense.benchmarks import options
from contactsense.benchmarks.calibration.force_threshold import force_threshold
from contactsense.benchmarks.calibration.recordings import (
    FREE,
    JOINTWISE,
    MOVING_FILES,
    calibrated_scene,
    read,
)
from contactsense.benchmarks.posterior.samples import Samples, of_primitives
from contactsense.benchmarks.statistics.reliability import reliability
from contactsense.calibration import FreeMotion
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, build_model, empty_motion
from contactsense.runtime.result_rows import PROBABILITY
from contactsense.scene import LinkPrior, Scene
from contactsense.service.cli.options.finite_range import FiniteRange

Draw = Literal["area", "link"]
FORCES = (20.0, 150.0)
"""Range of normal forces, log-uniform [N]."""
FRICTION = 0.5
RISE, PAUSES = 0.05, (0.8, 1.6)
"""Time in which a touch rises and falls, range of the pauses [s]."""
JUDGED = 0.6
"""Share of a touch's duration after which the answer is taken."""
FIRST_LINK = 2
"""Links before this one move one joint or none: their touches are not drawn."""
EXPONENTS = (0.5, 0.7, 1.0, 1.4, 2.0)
"""The probabilities are also scored after raising them to these powers: a best power below one would mean
that the evidence counts errors as independent that are not."""
FORCE_RANGES = 4
"""Ranges of forces, equal in the logarithm, for which the share of detected touches is printed."""
_SPACING = 0.01
_POSITIVE = FiniteRange(0.0, min_open=True)
_LEAST = 1e-6
"""Smaller probabilities are scored as this."""


class Touch(NamedTuple):
    """One touch, and the answer to it."""

    recording: str
    link: int
    """Index of the touched link."""
    force: float
    """Normal force [N]."""
    probability: tuple[float, ...] | None
    """Of each link; None if no contact was detected."""
    clear: bool
    """Whether the answer is a clear one."""


def touch(
    localizer: Localizer,
    recording: FreeMotion,
    samples: Samples,
    draw: Draw,
    seed: int,
    least: float = FORCES[0],
    seconds: float = 0.5,
) -> list[Touch]:
    """Add touches to one recording, process it as a live stream, and evaluate each touch.

    Args:
        localizer: Of the calibrated arm, with joint torques.
        recording: Free motion.
        samples: Patches of the arm's surface, from which the touched places are drawn.
        draw: Whether places are uniform by area or links equally frequent.
        seed: Of times, places and forces.
        least: Smallest normal force [N].
        seconds: Duration of each touch [s].
    """
    assert recording.torque is not None
    rng = np.random.default_rng(seed)
    motion, model = empty_motion(recording.q.shape[1]), build_model(localizer.scene.robot)
    t, torque = recording.t - recording.t[0], recording.torque.copy()
    made: dict[int, tuple[int, float]] = {}
    start = rng.uniform(*PAUSES)
    while start + seconds < t[-1]:
        rows = np.flatnonzero((t >= start) & (t < start + seconds))
        forward_kinematics(model, recording.q[rows[0]], motion)
        patch, link = _place(samples, recording.q[rows[0]], draw, rng)
        normal = motion.rotation[link] @ samples.normal[patch]
        push = float(np.exp(rng.uniform(*np.log((least, FORCES[1])))))
        force = push * (_across(normal, rng) - normal)
        for row in rows:
            level = min(1.0, (t[row] - start) / RISE, (start + seconds - t[row]) / RISE)
            forward_kinematics(model, recording.q[row], motion)
            torque[row] -= _joint_torques(motion, samples.point[patch], link, level * force)
        made[int(np.searchsorted(t, start + JUDGED * seconds))] = link, push
        start += seconds + rng.uniform(*PAUSES)
    answers: dict[int, tuple[tuple[float, ...], bool]] = {}
    first = 0
    for part in localizer.run_blocks([SampleBlock(recording.t, recording.q, recording.qd, torque)]):
        for sample, row, probability in zip(part.sample, part.rows, part.link_probability, strict=True):
            answers[first + int(sample)] = (
                tuple(map(float, probability)),
                bool(row[PROBABILITY] >= localizer.scene.clear),
            )
        first += len(part)
    return [
        Touch(recording.name, link, push, *answers.get(sample, (None, False)))
        for sample, (link, push) in made.items()
    ]


def _place(samples: Samples, q: np.ndarray, draw: Draw, rng: np.random.Generator) -> tuple[int, int]:
    """A random patch that no neighbouring link covers in this posture, and its link."""
    bins = samples.covered.shape[2]
    angle = np.floor((q + np.pi) / (2.0 * np.pi) % 1.0 * bins).astype(int)
    links = len(samples.start) - 1
    while True:
        first, last = samples.start[FIRST_LINK], samples.start[links]
        if draw == "link":
            link = int(rng.integers(FIRST_LINK, links))
            first, last = samples.start[link], samples.start[link + 1]
        # Patches are equal in area up to rounding.
        patch = int(rng.integers(first, last))
        link = int(np.searchsorted(samples.start, patch, side="right")) - 1
        before = samples.covered[patch, 0, angle[link - 1]]
        if not before and not (link < len(q) and samples.covered[patch, 1, angle[link]]):
            return patch, link


def _across(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A vector in the tangent plane, uniform in the disc of radius `FRICTION`."""
    across = rng.standard_normal(3)
    across -= (across @ normal) * normal
    return np.asarray(across * FRICTION * np.sqrt(rng.random()) / np.linalg.norm(across))


def _joint_torques(motion: Motion, point: np.ndarray, link: int, force: np.ndarray) -> np.ndarray:
    """s_j . w of a force at a point in the link's frame, zero beyond the link, shape (n,) [Nm]."""
    place = motion.origin[link] + motion.rotation[link] @ point
    torques = np.zeros(len(motion.screw))
    torques[:link] = motion.screw[:link] @ np.concatenate((force, np.cross(place, force)))
    return torques


def false_alarms(localizer: Localizer, recording: FreeMotion) -> int:
    """Number of contacts that a stream of this recording reports without any touch."""
    block = SampleBlock(recording.t, recording.q, recording.qd, recording.torque)
    return max(int(part.number.max()) for part in localizer.run_blocks([block]))


def summarize(touches: list[Touch]) -> dict[str, Any]:
    """Shares, calibration error and scores of the touches that were answered."""
    answered = [found for found in touches if found.probability is not None]
    probability = np.array([found.probability for found in answered])
    link = np.array([found.link for found in answered])
    right = probability.argmax(axis=1) == link
    stated = probability.max(axis=1)
    clear = np.array([found.clear for found in answered])
    sure = stated > 0.9
    # What is missing to one is the probability of no single push on a link.
    rest = np.maximum(1.0 - probability.sum(axis=1, keepdims=True), 0.0)
    every = np.maximum(np.hstack((probability, rest)), _LEAST)
    scores = {}
    for exponent in EXPONENTS:
        power = every**exponent
        own = power[np.arange(len(link)), link] / power.sum(axis=1)
        scores[exponent] = float(np.mean(np.log(own)))
    return {
        "touches": len(touches),
        "answered": len(answered),
        "right": int(right.sum()),
        "stated": float(stated.mean()),
        "calibration": reliability(stated, right).as_json(),
        "clear": int(clear.sum()),
        "clear_wrong": int((clear & ~right).sum()),
        "above_0.9": {
            "answers": int(sure.sum()),
            "right": int((sure & right).sum()),
            "stated": float(stated[sure].mean()) if sure.any() else None,
        },
        "log_score": scores,
    }


def detected_shares(touches: list[Touch], edges: np.ndarray) -> dict[int, list[tuple[int, int]]]:
    """Number of touches, and of those that are detected, for each touched link and each range of forces,
    whose edges are given in ascending order [N]."""
    links = sorted({found.link for found in touches})
    counts = {link: np.zeros((len(edges) - 1, 2), dtype=int) for link in links}
    for found in touches:
        k = int(np.clip(np.searchsorted(edges, found.force, side="right") - 1, 0, len(edges) - 2))
        counts[found.link][k] += (1, found.probability is not None)
    return {link: [(int(all_), int(found)) for all_, found in counts[link]] for link in links}


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--draw",
    type=click.Choice(get_args(Draw)),
    default="area",
    show_default=True,
    help="Places uniform by area, or links equally frequent.",
)
@options.link_prior
@click.option("--moving", is_flag=True, help="Only recordings in which the whole arm moves.")
@click.option(
    "--least",
    type=FiniteRange(0.0, FORCES[1], min_open=True, max_open=True),
    default=FORCES[0],
    show_default=True,
    help="Smallest force [N].",
)
@click.option("--seconds", type=_POSITIVE, default=0.5, show_default=True, help="Duration of each touch [s].")
@click.option(
    "--bandwidth",
    type=_POSITIVE,
    default=Scene.model_fields["bandwidth"].default,
    show_default=True,
    help="Cut-off frequency of the observer [Hz]; the arm is calibrated with it.",
)
@click.option(
    "--seeds", type=click.IntRange(min=1), default=4, show_default=True, help="Passes over the recordings."
)
@options.as_json
def touches(
    folder: Path,
    draw: Draw,
    link_prior: LinkPrior,
    moving: bool,
    least: float,
    seconds: float,
    bandwidth: float,
    seeds: int,
    as_json: bool,
) -> None:
    """Add known touches to the recordings of free motion in FOLDER that calibration has not seen, and test
    the stated probability of the touched link. Each touch is evaluated after 60 % of its duration."""
    try:
        scene = calibrated_scene(folder, bandwidth).model_copy(update={"link_prior": link_prior})
        names = MOVING_FILES if moving else JOINTWISE + FREE
        recordings = [read(folder / f"{name}.csv.gz", scene)[0] for name in names]
    except FileNotFoundError as error:
        raise click.ClickException(f"{error.filename}: no such recording") from None
    localizer, samples = Localizer(scene), of_primitives(scene, _SPACING)
    alarms = sum(false_alarms(localizer, recording) for recording in recordings)
    found: list[Touch] = []
    runs = [(recording, seed) for seed in range(seeds) for recording in recordings]
    for k, (recording, _) in enumerate(
        track(runs, "touching", console=Console(stderr=True), transient=True, disable=as_json)
    ):
        found += touch(localizer, recording, samples, draw, k, least, seconds)
    if not any(item.probability for item in found):
        raise click.ClickException(
            f"--seeds {seeds}, --seconds {seconds:g}: expected at least one detected touch, got none"
        )
    edges = np.geomspace(least, FORCES[1], FORCE_RANGES + 1)
    detected = detected_shares(found, edges)
    summary = summarize(found) | {
        "free_seconds": float(sum(recording.t[-1] - recording.t[0] for recording in recordings)),
        "false_alarms": alarms,
        "force_edges": edges.tolist(),
        "detected": {scene.robot.links[link].name: shares for link, shares in detected.items()},
        "force_thresholds": {
            scene.robot.links[link].name: force_threshold(
                sum(n for _, n in shares), sum(n for n, _ in shares), least, FORCES[1]
            )
            for link, shares in detected.items()
        },
    }
    if as_json:
        click.echo(json.dumps(summary, indent=1))
        return
    _print(summary)


def _print(summary: dict[str, Any]) -> None:
    console, trust, sure = Console(width=110), summary["calibration"], summary["above_0.9"]
    console.print(
        f"{summary['touches']} touches, {summary['answered']} detected; "
        f"the most probable link is touched in {100 * summary['right'] / summary['answered']:.1f} %, "
        f"stated {100 * summary['stated']:.1f} %\n"
        f"calibration error {100 * trust['error']:.1f} %; true probabilities: "
        f"{100 * trust['by_chance']:.1f} % by chance, in 95 % of cases less than "
        f"{100 * trust['by_chance_95']:.1f} %\n"
        f"answers above 0.9: {sure['answers']}, right: {sure['right']}; "
        f"clear: {summary['clear']}, wrong: {summary['clear_wrong']}\n"
        f"without touches: {summary['false_alarms']} false alarms in {summary['free_seconds']:.0f} s"
    )
    table = Table("probability", "answers", "stated", "right", title="Probability of the most probable link")
    for entry in trust["bins"]:
        table.add_row(
            f"{entry['low']:.1f} to {entry['high']:.1f}",
            str(entry["samples"]),
            f"{100 * entry['stated']:.0f} %",
            f"{100 * entry['right']:.0f} %",
        )
    console.print(table)
    scores = ", ".join(f"{exponent:g}: {score:.3f}" for exponent, score in summary["log_score"].items())
    console.print(f"mean log probability of the touched link, probabilities to the power of {scores}")
    edges = summary["force_edges"]
    ranges = (f"{a:.0f} to {b:.0f} N" for a, b in pairwise(edges))
    table = Table("touched link", *ranges, "smallest detected force, 95 % interval [N]", title="Detected")
    for link, shares in summary["detected"].items():
        mean, low, high = summary["force_thresholds"][link]
        counts = (f"{found} of {all_}" for all_, found in shares)
        table.add_row(link, *counts, f"{mean:.0f} ({low:.0f} to {high:.0f})")
    console.print(table)
