"""`contactsense bench calibration-several`: calibration of the stated probabilities and regions for several
simultaneous contacts."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.progress import Progress

from contactsense import Contact, Estimate, Explanation, Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.multi_contact.calibration_summary import (
    plain,
    print_reliability,
    print_summary,
    summarize,
)
from contactsense.benchmarks.multi_contact.calibration_verdict import Verdict, is_best, verdict
from contactsense.benchmarks.multi_contact.measure import Scenario, localizer_for
from contactsense.benchmarks.multi_contact.mesh_trials import MeshTrials
from contactsense.benchmarks.multi_contact.trials import Trial, Trials
from contactsense.benchmarks.static_truth.cases import COLUMNS, SENSORS, Detail, Noise
from contactsense.service.cli.options.finite_range import FiniteRange

SCENARIOS = {
    "forces held": Scenario("one_by_one", 0.5),
    "forces free": Scenario("one_by_one", None),
    "at once": Scenario("at_once", None),
}
"""What is known when the last contact is located, see `Scenario`."""


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
    """Verdicts on trials with this number of contacts on different links; None without an answer with that
    number.

    An answer with fewer is not evaluated: how often there are several contacts is the scene's to say, and
    here there always are.

    One by one, only trials are evaluated in which the best explanation of the earlier contacts is the true
    one: they are taken as known.

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
        trial = trials.draw(contacts, force, "different")
        pushes = list(trial.pushes)
        known: tuple[Contact, ...] = ()
        for number in range(1, contacts + 1) if one_by_one else (contacts,):
            if one_by_one:
                pushes[: number - 1] = [trials.changed(push, scenario.drift) for push in pushes[: number - 1]]
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
            if not sets or not is_best(contacts_of_sets, links, points[None])[0]:
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


@click.command()
@options.robots
@click.option("--contacts", type=click.IntRange(2, 3), multiple=True, default=(2,), help="May be repeated.")
@options.trials(400)
@options.force("Size of each force [N].")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Seed of the random numbers: tune with one, evaluate with another.",
)
@click.option(
    "--arriving", type=click.Choice(list(SCENARIOS)), multiple=True, default=tuple(SCENARIOS),
    help="What is known before the last contact; may be repeated.",
)  # fmt: skip
@click.option(
    "--drift", type=FiniteRange(0.0, min_open=True), default=0.5, show_default=True,
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
    with the right number of contacts are evaluated. One by one, only trials are evaluated in which the best
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
        click.echo(json.dumps([plain(r) for r in results]))
        return
    where = "primitives" if truth is None else f"meshes, detail {detail}"
    print_summary(results, f"{where}, sensors {sensors}, {force:g} N, held to {drift:g} N, seed {seed}")
    if not brief:
        print_reliability(results)
