"""`contactsense bench calibration-several`: calibration of the stated probabilities and regions for several
simultaneous contacts."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from scipy.stats import chi2

from contactsense import Contact, Estimate, Explanation, Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.calibration import NEAR, REGION, Share
from contactsense.benchmarks.accuracy.credible_regions import distance, level, mixture, samples
from contactsense.benchmarks.accuracy.reliability import Reliability, reliability
from contactsense.benchmarks.accuracy.static_cases import COLUMNS, SENSORS, Detail, Noise
from contactsense.benchmarks.multi_contact.measure import Scenario, localizer_for
from contactsense.benchmarks.multi_contact.mesh_trials import MeshTrials
from contactsense.benchmarks.multi_contact.trials import Trial, Trials

SCENARIOS = {
    "forces held": Scenario("one_by_one", 0.5),
    "forces free": Scenario("one_by_one", None),
    "at once": Scenario("at_once", None),
}
"""What is known when the last contact is located, see `Scenario`."""
_EDGE = float(np.sqrt(chi2.isf(1e-3, 2)))
"""Number of standard deviations within which a place belongs to an explanation."""
_SHIFT = 97
"""Offset between the draws of one contact and the next one of the same explanation."""


class Verdict(NamedTuple):
    """What one estimate stated, and what was correct."""

    answer: tuple[float, bool, float]
    """Probability of the best explanation, whether it is the true one, and how probable that is for truths
    drawn from the explanations: where two overlap, the truth of one may be nearer to the other."""
    in_region: tuple[bool, ...]
    """Whether the region of highest density with the probability `REGION` contains the truth, of each
    contact."""
    listed: float
    """Sum of the probabilities of all explanations."""
    error: float
    """Distance of the best explanation's contact that is farthest from its truth [m]; infinite with another
    number of contacts."""


def verdict(
    explanations: Sequence[Explanation], links: np.ndarray, points: np.ndarray, ordered: bool
) -> Verdict:
    """Compare one estimate with the truth.

    Args:
        explanations: Sets of contacts, most probable first; at least one.
        links: Indices of the touched links, shape (K,).
        points: True places, base frame, shape (K, 3) [m].
        ordered: Whether the contacts of each explanation are in the order of the truth; else both are put in
            the order of their links.
    """
    sets = [tuple(e.contacts) for e in explanations]
    if not ordered:
        sets = [tuple(sorted(contacts, key=lambda contact: contact.link_index)) for contacts in sets]
        order = np.argsort(links, kind="stable")
        links, points = links[order], points[order]
    probability = np.array([e.probability for e in explanations])
    drawn = [_is_best(sets, *_draws(contacts)).mean() for contacts in sets]
    is_best = bool(_is_best(sets, links, points[None])[0])
    in_region = []
    for i, (link, point) in enumerate(zip(links, points, strict=True)):
        there = [k for k, contacts in enumerate(sets) if i < len(contacts)]
        stated = mixture([sets[k][i] for k in there])._replace(weight=probability[there])
        in_region.append(level(stated, int(link), point) < REGION)
    return Verdict(
        answer=(float(probability[0]), is_best, float(probability @ np.array(drawn))),
        in_region=tuple(in_region),
        listed=float(probability.sum()),
        error=_worst_error(sets[0], points),
    )


def _worst_error(contacts: tuple[Contact, ...], points: np.ndarray) -> float:
    if len(contacts) != len(points):
        return float("inf")
    found = np.array([contact.point_base for contact in contacts])
    return float(np.linalg.norm(found - points, axis=1).max())


def _draws(contacts: tuple[Contact, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Links of an explanation's contacts, shape (K,), and equally probable places, shape (N, K, 3)."""
    stated = mixture(contacts)
    points = samples(stated)
    return stated.link, np.stack(
        [np.roll(points[i], i * _SHIFT, axis=0) for i in range(len(contacts))], axis=1
    )


def _is_best(sets: Sequence[tuple[Contact, ...]], links: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether the first explanation is the true one, for N truths.

    It has the right links, each place is not farther than `NEAR` or inside the 99.9 % ellipse, and no other
    explanation with these links is nearer, in the contact farthest from it.

    Args:
        sets: Explanations.
        links: Of the truths, shape (K,).
        points: Shape (N, K, 3) [m].
    """
    away = np.full((len(sets), len(points)), np.inf)
    for k, contacts in enumerate(sets):
        if [contact.link_index for contact in contacts] == list(links):
            mean = np.array([contact.point_base for contact in contacts])
            away[k] = np.linalg.norm(points - mean, axis=2).max(axis=1)
    reached = np.isfinite(away[0])
    if reached.any():
        stated = mixture(sets[0])
        for i, contact in enumerate(sets[0]):
            near = np.linalg.norm(points[:, i] - contact.point_base, axis=1) <= NEAR
            reached &= near | (distance(stated, contact.link_index, points[:, i])[i] <= _EDGE)
    return np.asarray(reached & (np.argmin(away, axis=0) == 0))


def judge(
    localizer: Localizer,
    noise: Noise,
    count: int,
    contacts: int,
    scenario: Scenario,
    *,
    trials: Trials | None = None,
    force: float = 20.0,
    seed: int = 1,
    tick: Callable[[], object] = lambda: None,
) -> Iterator[Verdict | None]:
    """Verdicts on trials with so many contacts on different links; None without an answer with so many.

    An answer with fewer is not judged: how often there are several contacts is the scene's to say, and here
    there always are.

    One by one, only trials are judged in which the best explanation of the earlier contacts is the true one:
    they are taken as known.

    Args:
        localizer: See `contactsense.benchmarks.multi_contact.measure.localizer_for`.
        noise: Added to every sample.
        count: Number of trials.
        contacts: Number of contacts in each.
        scenario: How they start.
        trials: Draws them; None: on the primitives of the localizer.
        force: Magnitude of each force [N].
        seed: Random seed.
        tick: Called after each trial.
    """
    trials = Trials(localizer.scene, seed) if trials is None else trials
    rng = np.random.default_rng(seed + 1)
    one_by_one = scenario.arrival == "one_by_one"
    for _ in range(count):
        trial = trials.draw(contacts, force, "different", "cone")
        pushes = list(trial.pushes)
        known: tuple[Contact, ...] = ()
        for number in range(1, contacts + 1) if one_by_one else (contacts,):
            if one_by_one:
                pushes[: number - 1] = [
                    trials.changed(push, scenario.drift, "cone") for push in pushes[: number - 1]
                ]
            now = trial.measure(pushes[:number])
            estimate = _locate(localizer, trial, now, noise, rng, number, known, scenario.drift)
            links = np.array([push.link for push in pushes[:number]])
            points = np.array([push.point for push in pushes[:number]])
            sets = estimate.explanations or tuple(
                Explanation((contact,), contact.probability) for contact in estimate.contacts
            )
            if number == contacts:
                counted = len(sets) > 0 and len(sets[0].contacts) == number
                yield verdict(sets, links, points, bool(known)) if counted else None
                break
            contacts_of_sets = [tuple(e.contacts) for e in sets]
            if not sets or not _is_best(contacts_of_sets, links, points[None])[0]:
                break
            known = contacts_of_sets[0]
        tick()


def _locate(
    localizer: Localizer,
    trial: Trial,
    measured: tuple[np.ndarray, np.ndarray],
    noise: Noise,
    rng: np.random.Generator,
    contacts: int,
    known: Sequence[Contact],
    drift: float | None,
) -> Estimate:
    """The estimate from a noisy measurement by the sensors of the localizer."""
    base, torque = measured
    base = base + rng.standard_normal(6) * np.repeat(noise[:2], 3)
    torque = torque + rng.standard_normal(len(torque)) * noise.torque
    return localizer.locate(
        trial.q,
        base_wrench=base if localizer.scene.base_wrench is not None else None,
        joint_torque=torque if localizer.scene.joint_torque is not None else None,
        detect=False,
        contacts=contacts,
        known=known,
        drift=drift,
    )


class Summary(NamedTuple):
    """All verdicts of one case."""

    robot: str
    noise: Noise
    contacts: int
    arriving: str
    samples: int
    """Estimates."""
    counted: float
    """Fraction of them with that number of contacts. Only these are judged."""
    answer: Reliability
    earlier: Share
    """Fraction of the contacts before the last whose region contains the truth."""
    last: Share
    """The same of the last contact; of all contacts, if they are located at once."""
    listed: float
    """Mean of the listed probability."""
    median_mm: float
    """Median distance of the contact that is farthest from its truth [mm]."""


def summarize(
    robot: str, noise: Noise, contacts: int, arriving: str, verdicts: Sequence[Verdict | None]
) -> Summary:
    """Count the correct statements."""
    judged = [v for v in verdicts if v is not None]
    stated, right, expected = np.array([v.answer for v in judged]).reshape(-1, 3).T
    regions = np.array([v.in_region for v in judged]).reshape(-1, contacts)
    last = regions if arriving == "at once" else regions[:, -1:]
    earlier = regions[:, : contacts - last.shape[1]]
    return Summary(
        robot=robot,
        noise=noise,
        contacts=contacts,
        arriving=arriving,
        samples=len(verdicts),
        counted=len(judged) / len(verdicts) if verdicts else float("nan"),
        answer=reliability(stated, right > 0.0, expected),
        earlier=Share.of(int(earlier.sum()), earlier.size),
        last=Share.of(int(last.sum()), last.size),
        listed=float(np.mean([v.listed for v in judged])) if judged else float("nan"),
        median_mm=1e3 * float(np.median([v.error for v in judged])) if judged else float("nan"),
    )


@click.command()
@options.robots
@click.option("--contacts", type=click.IntRange(2, 3), multiple=True, default=(2,), help="May be repeated.")
@click.option("--trials", type=click.IntRange(1), default=400, show_default=True, help="Of each kind.")
@click.option("--force", type=float, default=20.0, show_default=True, help="Size of each force [N].")
@click.option("--seed", default=1, show_default=True, help="Tune with one, judge with another.")
@click.option(
    "--arriving", type=click.Choice(list(SCENARIOS)), multiple=True, default=tuple(SCENARIOS),
    help="What is known before the last contact; may be repeated.",
)  # fmt: skip
@click.option(
    "--drift", type=click.FloatRange(0.0, min_open=True), default=0.5, show_default=True,
    help="Change of each component of the held forces [N].",
)  # fmt: skip
@click.option(
    "--sensors", type=click.Choice(list(SENSORS)), default="all", show_default=True, help="What is measured."
)
@click.option(
    "--truth", type=options.FOLDER,
    help="Push the meshes: at the places of static_points_ROBOT.npz in this folder.",
)  # fmt: skip
@options.fitted_detail
@click.option("--brief", is_flag=True, help="Leave the reliability table out.")
@options.as_json
def calibration_several(
    robots: tuple[str, ...],
    contacts: tuple[int, ...],
    trials: int,
    force: float,
    seed: int,
    arriving: tuple[str, ...],
    drift: float,
    sensors: str,
    truth: Path | None,
    detail: Detail,
    brief: bool,
    as_json: bool,
) -> None:
    """Compare what is stated about several contacts with what is right.

    The contacts are those of `contactsense bench several`, or with --truth at places on the meshes. Answers
    with the right number of contacts are judged. One by one, only trials are judged in which the best
    explanation of the earlier contacts is the true one: the answer takes them as known.

    \b
    answer  the probability of the best explanation, against whether it is the true one: the right links, each
            truth no farther than 20 mm or inside the 99.9 % ellipse, and no other explanation nearer
    region  how often the smallest region that holds 90 % of a contact's probability holds the truth, for the
            contacts before the last, and for the last (at once: all)
    """
    cases = [
        (robot, noise, n, way) for robot in robots for noise in COLUMNS for n in contacts for way in arriving
    ]
    results = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("locating", total=len(cases) * trials)
        for robot, noise, n, way in cases:
            localizer = localizer_for(robot, noise, detail=detail, sensors=sensors)
            scenario = SCENARIOS[way]
            if scenario.drift is not None:
                scenario = scenario._replace(drift=drift)
            verdicts = judge(
                localizer, noise, trials, n, scenario, force=force, seed=seed,
                trials=None if truth is None else MeshTrials(localizer.scene, seed, truth, robot),
                tick=lambda: progress.advance(task),
            )  # fmt: skip
            results.append(summarize(robot, noise, n, way, list(verdicts)))
    if as_json:
        click.echo(json.dumps([_plain(r) for r in results]))
        return
    where = "primitives" if truth is None else f"meshes, detail {detail}"
    _print_summary(results, f"{where}, sensors {sensors}, {force:g} N, held to {drift:g} N, seed {seed}")
    if not brief:
        _print_reliability(results)


def _plain(summary: Summary) -> dict[str, Any]:
    plain = summary._asdict() | {
        "noise": summary.noise._asdict(),
        "answer": summary.answer.as_json(),
        "earlier": None if np.isnan(summary.earlier.found) else summary.earlier._asdict(),
        "last": summary.last._asdict(),
    }
    if summary.counted == 0.0:
        plain |= dict.fromkeys(("answer", "earlier", "last", "listed", "median_mm"))
    return plain


def _print_summary(results: Sequence[Summary], what: str) -> None:
    table = Table(
        title=f"calibration, several contacts, {what}",
        caption=(
            "counted: answers with the right number of contacts; of these, answer: calibration error of the "
            "stated probabilities, in brackets what it is if the truths are distributed as stated, on "
            "average and at most in 19 of 20 cases; earlier, last: share of the "
            "truths in the regions of 90 %, with its 95 % interval; listed: sum of the listed probabilities; "
            "median: distance of the contact that is farthest from its truth, mm"
        ),
    )
    for name in ("arm", "noise N / Nm / Nm", "contacts", "arriving"):
        table.add_column(name, no_wrap=name != "contacts")
    for name in ("trials", "counted", "answer", "earlier", "last", "listed", "median"):
        table.add_column(name, justify="right", no_wrap=True)
    for r in results:
        judged = (
            "{:.1f} ({:.1f}, {:.1f}) %".format(*(100.0 * x for x in r.answer[:3])),
            "" if np.isnan(r.earlier.found) else str(r.earlier),
            str(r.last),
            f"{100 * r.listed:.1f} %",
            f"{r.median_mm:.1f}",
        )
        table.add_row(
            r.robot,
            str(r.noise),
            str(r.contacts),
            r.arriving,
            str(r.samples),
            f"{100 * r.counted:.1f} %",
            *(judged if r.counted > 0.0 else ()),
        )
    Console(width=160).print(table)


def _print_reliability(results: Sequence[Summary]) -> None:
    table = Table(title="answer: stated -> right in %, and how many, by stated probability")
    for name in ("arm", "noise", "contacts", "arriving"):
        table.add_column(name, no_wrap=True)
    for k in range(10):
        table.add_column(f"{10 * k}-{10 * k + 10}", justify="right")
    for r in results:
        cells = {
            round(10 * entry.low): f"{100 * entry.stated:.0f}->{100 * entry.right:.0f}\n{entry.samples}"
            for entry in r.answer.bins
        }
        table.add_row(
            r.robot,
            f"{r.noise.force:g} N",
            str(r.contacts),
            r.arriving,
            *(cells.get(k, "") for k in range(10)),
        )
    Console(width=168).print(table)
