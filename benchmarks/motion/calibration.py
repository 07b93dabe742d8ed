"""`contactsense bench motion-calibration FOLDER`: probabilities and regions of contacts in a stream."""

import json
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console
from rich.progress import track

from contactsense import Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.calibration import (
    Summary,
    Verdict,
    plain,
    print_summary,
    summarize,
    verdict,
)
from contactsense.benchmarks.motion import options as motion_options
from contactsense.benchmarks.motion.command import samples, scene_for
from contactsense.benchmarks.motion.model_error import with_drawn_masses
from contactsense.benchmarks.motion.options import MODELS
from contactsense.benchmarks.motion.score import AGES, samples_at_ages
from contactsense.benchmarks.motion.streams import Stream, read, redrawn, with_velocity_noise
from contactsense.benchmarks.static_truth.cases import COLUMNS, Noise
from contactsense.benchmarks.truth_arms import files_of
from contactsense.service.cli.options.finite_range import FiniteRange


@click.command("motion-calibration")
@options.truth_folder
@options.truth_robots
@motion_options.suites(("motion",))
@motion_options.levels()
@motion_options.model("exact")
@motion_options.draws(1)
@motion_options.velocity_noise()
@click.option(
    "--mass-error",
    type=FiniteRange(0.0, 1.0),
    default=0.0,
    show_default=True,
    help="Relative standard deviation of each mass of the model, drawn for each run and stated as "
    "inertia_error.",
)
@options.as_json
def motion_calibration(
    folder: Path,
    robots: tuple[str, ...],
    suites: tuple[str, ...],
    levels: tuple[int, ...],
    model: str,
    draws: int,
    velocity_noise: float,
    mass_error: float,
    as_json: bool,
) -> None:
    """Compare stated probabilities with what is right, for the contacts of arms that move and rest in FOLDER
    (motion_ROBOT.npz): one answer of each contact 0.02, 0.1, 0.3 and 1 s after its onset, at rest and in
    motion, contacts that slide apart from those that hold their place. Columns as in `contactsense bench
    calibration`; region: of the contacts with an answer.
    """
    streams = {
        pair: [with_velocity_noise(run, velocity_noise) for run in read(folder, *pair)]
        for pair in files_of(folder, robots, suites)
    }
    rounds = [
        (name, suite, COLUMNS[level], wrong)
        for wrong in MODELS[model]
        for name, suite in streams
        for level in levels
    ]
    results: list[Summary] = []
    for name, suite, noise, wrong in track(
        rounds, description="stepping", console=Console(stderr=True), transient=True
    ):
        results += summaries(streams[name, suite], noise, wrong, draws, mass_error)
    if as_json:
        click.echo(
            json.dumps(
                {
                    "model": model,
                    "velocity_noise": velocity_noise,
                    "mass_error": mass_error,
                    "results": [plain(result) for result in results],
                }
            )
        )
        return
    print_summary(results, "contacts over time", "after")


def summaries(
    streams: Sequence[Stream], noise: Noise, wrong: bool, draws: int = 1, mass_error: float = 0.0
) -> list[Summary]:
    """Process all streams of one arm; one summary of the answers at each age, slides apart. `mass_error`: as
    for `contactsense.benchmarks.motion.model_error.with_drawn_masses`."""
    scene = scene_for(streams[0], noise, wrong)
    localizer = Localizer(scene)
    rows = {
        f"{age:g} s{suffix}": (age, slides)
        for slides, suffix in ((False, ""), (True, ", slide"))
        for age in AGES
    }
    verdicts: dict[tuple[float, bool], list[Verdict | None]] = {row: [] for row in rows.values()}
    for number, stream in enumerate(streams):
        if mass_error:
            localizer = Localizer(with_drawn_masses(scene, mass_error, number))
        for draw in range(draws if any(noise) else 1):
            drawn = redrawn(stream, draw)
            ages = samples_at_ages(drawn)
            for i, estimate in enumerate(localizer.run(samples(drawn, noise, wrong))):
                if i in ages:
                    link, point = int(drawn.link[i]), drawn.point_base[i]
                    judged = verdict(estimate.contacts, estimate.link_probability, link, point)
                    verdicts[ages[i], _slides(drawn, i)].append(judged)
    found = []
    for label, row in rows.items():
        judged_at = verdicts[row]
        answered = [one for one in judged_at if one is not None]
        if answered:
            kept = summarize(streams[0].robot, label, noise, answered)
            found.append(kept._replace(no_answer=1.0 - len(answered) / len(judged_at)))
    return found


def _slides(stream: Stream, sample: int) -> bool:
    """Whether the contact of a sample slides."""
    return any(event.type == "slide" and event.start <= sample < event.stop for event in stream.events)
