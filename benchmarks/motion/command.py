"""`contactsense bench motion FOLDER`: contacts on moving arms, as a ratio to the same contacts at rest."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.truth import error_quantiles
from contactsense.benchmarks.arms import arm
from contactsense.benchmarks.motion import options as motion_options
from contactsense.benchmarks.motion.at_rest import static_error, with_noise_scaled
from contactsense.benchmarks.motion.averaging_limit import averaging_limit
from contactsense.benchmarks.motion.model_error import (
    COULOMB,
    MASS_ERROR,
    assumed_friction,
    friction,
    heavier,
)
from contactsense.benchmarks.motion.options import MODELS
from contactsense.benchmarks.motion.score import AGES, Answer, Score
from contactsense.benchmarks.motion.streams import KINDS, SUITES, Stream, read, redrawn, with_velocity_noise
from contactsense.benchmarks.static_truth.cases import ASSUMED, COLUMNS, SENSORS, Noise
from contactsense.benchmarks.truth_arms import files_of, name_of
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.sensors.settings import Friction
from contactsense.service.cli.options.finite_range import FiniteRange


@click.command()
@options.truth_folder
@options.truth_robots
@motion_options.suites(SUITES)
@motion_options.levels()
@motion_options.model("both")
@motion_options.draws(1)
@motion_options.velocity_noise()
@click.option(
    "--sensors", type=click.Choice(list(SENSORS)), default="all", show_default=True, help="Sensors in use."
)
@click.option(
    "--bandwidth",
    type=FiniteRange(0.0, min_open=True),
    help="Cut-off of the observer [Hz]; default: the scene's.",
)
@click.option(
    "--over-time", is_flag=True, help="Print how link, error and ambiguity change while a contact lasts."
)
@options.as_json
def motion(
    folder: Path,
    robots: tuple[str, ...],
    suites: tuple[str, ...],
    levels: tuple[int, ...],
    model: str,
    draws: int,
    velocity_noise: float,
    sensors: str,
    bandwidth: float | None,
    over_time: bool,
    as_json: bool,
) -> None:
    """Process the ground truth of moving arms in FOLDER (motion_ROBOT.npz, probe_ROBOT.npz).

    Errors are those of all samples with an answer that were touched at one place by at least 5 N; their
    fraction is printed next to them. Ratios are to the same contacts on an arm at rest: the true wrench of
    each sample with the noise that the observer leaves, located without a stream.
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
    results: list[dict[str, Any]] = []
    for name, suite, noise, wrong in track(
        rounds, description="stepping", console=Console(stderr=True), transient=True
    ):
        results += measure(streams[name, suite], noise, wrong, bandwidth, draws, sensors, not over_time)
    if as_json:
        click.echo(
            json.dumps(
                {
                    "sensors": sensors,
                    "bandwidth": bandwidth,
                    "draws": draws,
                    "velocity_noise": velocity_noise,
                    "results": results,
                },
                indent=1,
            )
        )
        return
    for wrong in MODELS[model]:
        rows = [r for r in results if r["wrong_model"] == wrong]
        if over_time:
            _print_over_time(rows, _model(wrong, sensors))
        else:
            _print_table(rows, _model(wrong, sensors))


def scene_for(
    stream: Stream, noise: Noise, wrong: bool, bandwidth: float | None = None, sensors: str = "all"
) -> Scene:
    """The estimator's scene for a stream: the noise is known; masses and friction may be wrong, within their
    stated standard deviations. `sensors`: a key of `SENSORS`."""
    has_base, has_torque = SENSORS[sensors]
    stated = Noise(*(max(level, floor) for level, floor in zip(noise, ASSUMED, strict=True)))
    robot = arm(stream.robot)
    if wrong and len(robot.joints) != len(COULOMB):
        raise click.ClickException(
            f"{stream.robot}: expected --model exact, as the friction of the wrong model is that of "
            f"{len(COULOMB)} joints, got {len(robot.joints)}"
        )
    return Scene(
        robot=heavier(robot, MASS_ERROR) if wrong else robot,
        gravity=stream.gravity,
        base_wrench=WrenchSensor(force_noise=stated.force, moment_noise=stated.moment) if has_base else None,
        joint_torque=JointTorqueSensor(
            noise=stated.torque, friction=assumed_friction() if wrong else Friction()
        )
        if has_torque
        else None,
        inertia_error=MASS_ERROR if wrong else 0.0,
        **({} if bandwidth is None else {"bandwidth": bandwidth}),
    )


def samples(stream: Stream, noise: Noise, wrong: bool, sensors: str = "all") -> Iterator[Sample]:
    """Readings of the sensors with that noise; `wrong`: with joint friction."""
    has_base, has_torque = SENSORS[sensors]
    torque = stream.torque + noise.torque * stream.noise_torque
    if wrong:
        torque = torque + friction(stream.qd)
    wrench = stream.base_wrench + np.repeat(noise[:2], 3) * stream.noise_wrench
    for t, q, qd, tau, w in zip(stream.t.tolist(), stream.q, stream.qd, torque, wrench, strict=True):
        yield Sample(t, q, qd, tau if has_torque else None, w if has_base else None)


def measure(
    streams: Sequence[Stream],
    noise: Noise,
    wrong: bool,
    bandwidth: float | None = None,
    draws: int = 1,
    sensors: str = "all",
    at_rest: bool = True,
) -> list[dict[str, Any]]:
    """Process the streams of one arm and suite, `draws` times with different noise (once without); `at_rest`:
    compare with the same contacts at rest.

    Returns:
        One row per kind of motion, plain numbers for a table or JSON; errors in mm, None if there are none.
    """
    scene = scene_for(streams[0], noise, wrong, bandwidth, sensors)
    localizer = Localizer(scene)
    variance_ratio = noise_variance_ratio(scene.bandwidth, float(np.median(np.diff(streams[0].t))))
    still = tuple(np.sqrt(variance_ratio) * level for level in noise)
    stated = scene_for(streams[0], noise, wrong=False, bandwidth=bandwidth, sensors=sensors)
    resting = at_rest and Localizer(with_noise_scaled(stated, float(np.sqrt(variance_ratio))))
    results = []
    for kind in KINDS:
        score = Score()
        for stream in streams:
            for draw in range(draws if any(noise) else 1):
                if stream.kind == kind:
                    drawn = redrawn(stream, draw)
                    score.add(drawn, localizer.run(samples(drawn, noise, wrong, sensors)))
        if score.events:
            summary = _summary(score, resting, (still[0], still[1], still[2]), SENSORS[sensors])
            if not at_rest:
                for row in summary["over_time"]:
                    rows = score.at_age[row["age"]]
                    limit = averaging_limit(stated, rows, noise, row["age"], SENSORS[sensors])
                    row |= {"averaged_right": limit.link_right, "averaged_felt": limit.felt}
            results.append(
                {
                    "robot": name_of(streams[0].robot),
                    "suite": streams[0].suite,
                    "kind": kind,
                    "noise": noise._asdict(),
                    "wrong_model": wrong,
                    **summary,
                }
            )
    return results


def _summary(
    score: Score,
    resting: Localizer | Literal[False],
    noise: tuple[float, float, float],
    sensors: tuple[bool, bool],
) -> dict[str, Any]:
    error = 1e3 * np.array(score.error)
    static, static_right = np.empty(0), np.empty(0)
    if len(error) and resting:
        static, static_right = static_error(resting, score.rows, noise, sensors)
        static *= 1e3
    live, rest = error_quantiles(error), error_quantiles(static)
    delay = error_quantiles(1e3 * np.array(score.delay))
    return {
        "touched_samples": score.touched,
        "answered": len(error) / score.touched if score.touched else None,
        "link_right": float(np.mean(score.link_right)) if len(error) else None,
        "link_right_static": float(np.mean(static_right)) if len(static_right) else None,
        "clear": float(np.mean(score.clear)) if len(error) else None,
        "error_mm": live,
        "error_mm_static": rest,
        "ratio": {name: _ratio(live[name], rest[name]) for name in live},
        "events": score.events,
        "missed": score.missed,
        "masked": score.masked,
        "beside": score.beside,
        "delay_ms": delay,
        "over_time": _over_time(score.answers),
        "false_alarms": score.false_alarms,
        "free_hours": score.free / 3600.0,
    }


def _over_time(answers: Sequence[Answer]) -> list[dict[str, Any]]:
    rows = []
    for age in AGES:
        chosen = [answer for answer in answers if answer.age == age]
        answered = [answer for answer in chosen if np.isfinite(answer.error)]
        if chosen:
            rows.append(
                {
                    "age": age,
                    "contacts": len(chosen),
                    "link_right": float(np.mean([answer.link_right for answer in chosen])),
                    "answered": len(answered) / len(chosen),
                    "link_right_answered": _mean([answer.link_right for answer in answered]),
                    "link_stated": _mean([answer.stated for answer in answered]),
                    "apart": _mean([answer.apart for answer in answered]),
                    "ambiguous": float(np.mean([answer.ambiguous for answer in chosen])),
                    "error_mm": error_quantiles(1e3 * np.array([answer.error for answer in chosen])),
                }
            )
    return rows


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _ratio(live: float | None, rest: float | None) -> float | None:
    return live / rest if live is not None and rest else None


def _print_over_time(results: Sequence[dict[str, Any]], model: str) -> None:
    table = Table(
        title=f"contacts over time, {model}; errors in mm, missing answers included",
        caption=(
            "contacts: those that last so long after their onset, in runs without overlapping contacts; at "
            "best: if all samples since the onset were averaged without loss at the last posture; of them: "
            "link right of those answered; stated: mean probability stated for that link; apart: of those "
            "answered, more than 5 % of the probability is more than 20 mm from the answer"
        ),
    )
    for name in ("arm", "suite", "noise N", "motion"):
        table.add_column(name, no_wrap=True)
    for name in ("after s", "contacts", "link right", "at best", "answered", "at best", "of them", "stated",
                 "ambiguous", "apart", "median", "p95"):  # fmt: skip
        table.add_column(name, justify="right", no_wrap=True)
    for r in results:
        for row in r["over_time"]:
            table.add_row(
                r["robot"], r["suite"], f"{r['noise']['force']:g}", r["kind"],
                f"{row['age']:g}", str(row["contacts"]),
                _percent(row["link_right"]), _percent(row["averaged_right"]),
                _percent(row["answered"]), _percent(row["averaged_felt"]),
                _percent(row["link_right_answered"]), _percent(row["link_stated"]),
                _percent(row["ambiguous"]), _percent(row["apart"]),
                _number(row["error_mm"]["median"]), _number(row["error_mm"]["p95"]),
            )  # fmt: skip
    Console(width=172).print(table)


def _model(wrong: bool, sensors: str) -> str:
    model = "masses 2 % and friction 5 % wrong" if wrong else "masses exact, no friction"
    return model if sensors == "all" else f"{model}, sensors {sensors}"


def _print_table(results: Sequence[dict[str, Any]], model: str) -> None:
    table = Table(
        title=f"contacts in motion, {model}; errors in mm",
        caption=(
            "x rest: ratio to the same contacts at rest; answered: share of the touched samples with an "
            "answer; delay, missed: of contacts that do not begin beside another one; masked: contacts that "
            "began during a false alarm; alarms: false ones, and the minutes without contact"
        ),
    )
    for name in ("arm", "suite", "noise N", "motion"):
        table.add_column(name, no_wrap=True)
    for name in ("link", "rest", "median", "x rest", "p95", "x rest", "answered", "delay", "p95 ms",
                 "missed", "masked", "alarms"):  # fmt: skip
        table.add_column(name, justify="right", no_wrap=True)
    for r in results:
        events, missed = sum(r["events"].values()), sum(r["missed"].values())
        table.add_row(
            r["robot"], r["suite"], f"{r['noise']['force']:g}", r["kind"],
            _percent(r["link_right"]), _percent(r["link_right_static"]),
            _number(r["error_mm"]["median"]), _number(r["ratio"]["median"]),
            _number(r["error_mm"]["p95"]), _number(r["ratio"]["p95"]),
            _percent(r["answered"]),
            _number(r["delay_ms"]["median"], 0), _number(r["delay_ms"]["p95"], 0),
            f"{missed}/{events}", str(r["masked"]), f"{r['false_alarms']} in {60.0 * r['free_hours']:.1f}",
        )  # fmt: skip
    Console(width=160).print(table)


def _percent(value: float | None) -> str:
    return "." if value is None else f"{100.0 * value:.1f} %"


def _number(value: float | None, digits: int = 2) -> str:
    return "." if value is None else f"{value:.{digits}f}"
