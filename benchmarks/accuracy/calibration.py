"""`contactsense bench calibration FOLDER`: calibration of the stated probabilities and credible regions."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest, chi2

from contactsense import Contact, Localizer
from contactsense.benchmarks import options
from contactsense.benchmarks.static_truth.cases import (
    COLUMNS,
    Detail,
    Noise,
    measured,
    scene_of,
    stated_noise,
)
from contactsense.benchmarks.static_truth.points import HALVES, StaticPoints, read, select
from contactsense.benchmarks.statistics.credible_regions import (
    EDGE,
    Mixture,
    distance,
    explains,
    level,
    mixture,
    sample_distance,
    samples,
    within,
)
from contactsense.benchmarks.statistics.reliability import Reliability, reliability
from contactsense.benchmarks.truth_arms import name_of, static_arms
from contactsense.scene import LinkPrior

NEAR = 0.02
"""Distance within which a position counts as found [m]."""
REGION = 0.9
"""Probability of the credible region."""
_REGION_EDGE = float(np.sqrt(chi2.ppf(REGION, 2)))
"""Number of standard deviations to the edge of a candidate's own region."""
STATEMENTS = ("answer", "place", "link")
"""Probabilities that are checked, see the command's help."""


class Verdict(NamedTuple):
    """What one estimate stated, and what was correct."""

    answer: tuple[float, bool, float]
    """Probability of the best candidate, whether it is the true one, and how probable that is for truths
    drawn from the mixture: where two candidates overlap, the truth of one may be nearer to the other."""
    place: tuple[float, bool, float]
    """Probability of the mixture within `NEAR` of the best candidate, whether the truth is there, and how
    probable that is: the same."""
    link: tuple[float, bool, float]
    """Probability of the most probable link, whether it is the touched one, and how probable that is."""
    in_region: bool
    """Whether the region of highest density with the probability `REGION` contains the truth."""
    in_ellipse: bool | None
    """Whether the best explanation's own ellipse contains the truth; None if it is not the true one."""
    listed: float
    """Sum of the probabilities of all candidates."""


@click.command()
@options.truth_folder
@options.truth_robots
@options.sensor_sets
@options.detail
@options.meshes
@options.half
@options.link_prior
@click.option("--brief", is_flag=True, help="Leave the reliability tables out.")
@options.as_json
def calibration(
    folder: Path,
    robots: tuple[str, ...],
    kinds: tuple[str, ...],
    detail: Detail,
    meshes: Path | None,
    half: str,
    link_prior: LinkPrior,
    brief: bool,
    as_json: bool,
) -> None:
    """Compare stated probabilities with what is right, on the static contacts in FOLDER
    (static_points_ROBOT.npz).

    \b
    answer  the probability of the best explanation, against whether it is the true one: right link, of that
            link's explanations the one nearest to the truth, and the truth no farther than 20 mm or inside
            its 99.9 % ellipse
    place   the probability of all places within 20 mm of the best one, against whether the truth is there
    link    the probability of the most probable link, against whether it is the touched one
    region  how often the smallest region that holds 90 % of the probability holds the truth
    ellipse the same for the best explanation's own covariance, where that explanation is the true one
    """
    if detail == "skin" and meshes is None:
        raise click.UsageError("--detail skin needs --meshes")
    points = {robot: select(read(folder, robot), HALVES[half]) for robot in static_arms(folder, robots)}
    cases = [(robot, kind, noise) for robot in points for kind in kinds for noise in COLUMNS]
    results = [
        summarize(robot, kind, noise, judge(points[robot], noise, kind, detail, meshes, link_prior))
        for robot, kind, noise in track(
            cases, description="locating", console=Console(stderr=True), transient=True
        )
    ]
    if as_json:
        click.echo(json.dumps({"detail": detail, "half": half, "results": [plain(r) for r in results]}))
        return
    print_summary(results, f"static contacts, detail {detail}, contacts: {half}")
    if not brief:
        for statement in STATEMENTS:
            _print_reliability(statement, results)


def judge(
    points: StaticPoints,
    noise: Noise,
    sensors: str = "all",
    detail: Detail = "fine",
    meshes: Path | None = None,
    link_prior: LinkPrior = "area",
) -> list[Verdict | None]:
    """Locate all points with that noise and evaluate every estimate; None if there is no answer.

    The noise is that which the scene states, in rows without noise too: regions that allow for more than
    there is would hold too much.
    """
    localizer = Localizer(scene_of(points, noise, sensors, detail, meshes, link_prior))
    wrench, torque = measured(points, stated_noise(noise), sensors)
    verdicts = []
    for i, (q, link, point) in enumerate(zip(points.q, points.link, points.point_base, strict=True)):
        estimate = localizer.locate(
            q,
            base_wrench=None if wrench is None else wrench[i],
            joint_torque=None if torque is None else torque[i],
            external=False,
            detect=False,
        )
        verdicts.append(verdict(estimate.contacts, estimate.link_probability, int(link), point))
    return verdicts


def verdict(
    contacts: Sequence[Contact], link_probability: np.ndarray, link: int, point: np.ndarray
) -> Verdict | None:
    """Compare one estimate with the truth; None without an answer.

    Args:
        contacts: Explanations, most probable first.
        link_probability: Of each link, shape (links,).
        link: Number of the touched link.
        point: True place, base frame, shape (3,) [m].
    """
    if not contacts:
        return None
    best = contacts[0]
    stated = mixture(contacts)
    own, drawn = distance(stated, link, point[None]), sample_distance(stated)
    near = best.link_index == link and bool(np.linalg.norm(best.point_base - point) <= NEAR)
    reached = explains(stated, link, point[None])[0]
    is_true = bool(_is_best(stated, np.array([link]), point[None], reached)[0])
    points = samples(stated)
    inside = drawn[0] <= EDGE
    as_stated = _is_best(stated, np.repeat(stated.link, points.shape[1]), points.reshape(-1, 3), inside)
    found = within(stated, best.link_index, best.point_base, NEAR)
    likeliest = int(np.argmax(link_probability))
    probable = float(link_probability[likeliest])
    return Verdict(
        answer=(
            best.probability,
            is_true,
            float(stated.weight @ as_stated.reshape(points.shape[:2]).mean(axis=1)),
        ),
        place=(found, near, found),
        link=(probable, likeliest == link, probable),
        in_region=level(stated, link, point, drawn) < REGION,
        in_ellipse=bool(own[0, 0] <= _REGION_EDGE) if is_true else None,
        listed=float(stated.weight.sum()),
    )


def _is_best(stated: Mixture, link: np.ndarray, points: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Whether the first candidate is the true one for contacts at `points` (M, 3) on those links (M,): it is
    the nearest on the link, and not farther than `NEAR` or `inside` its 99.9 % ellipse (M,)."""
    meters = np.linalg.norm(stated.mean[:, None] - points, axis=2)
    meters[stated.link[:, None] != link] = np.inf
    reached = (meters[0] <= NEAR) | inside
    return np.asarray((stated.link[0] == link) & (np.argmin(meters, axis=0) == 0) & reached)


class Share(NamedTuple):
    """A frequency with its confidence interval."""

    found: float
    """Relative frequency; NaN without samples."""
    low: float
    high: float
    """Wilson's 95 % interval."""

    @classmethod
    def of(cls, right: int, samples: int) -> "Share":
        """`right` of `samples`."""
        if samples == 0:
            return cls(*(float("nan"),) * 3)
        interval = binomtest(right, samples).proportion_ci(method="wilson")
        return cls(right / samples, float(interval.low), float(interval.high))

    def __str__(self) -> str:
        return f"{100 * self.found:.1f} ({100 * self.low:.1f}-{100 * self.high:.1f}) %"


class Summary(NamedTuple):
    """All verdicts of one case."""

    robot: str
    sensors: str
    """Set of sensors, or what else distinguishes the cases."""
    noise: Noise
    samples: int
    no_answer: float
    statements: dict[str, Reliability]
    region: Share
    """Fraction of all samples whose region contains the truth; without an answer it does not."""
    ellipse: Share
    """Fraction of the samples with the true best explanation whose ellipse contains the truth."""
    listed: float
    """Mean of the listed probability."""


def summarize(robot: str, sensors: str, noise: Noise, verdicts: Sequence[Verdict | None]) -> Summary:
    """Count the correct statements."""
    judged = [v for v in verdicts if v is not None]
    ellipses = [v.in_ellipse for v in judged if v.in_ellipse is not None]
    statements = {}
    for name in STATEMENTS:
        stated, right, expected = np.array([getattr(v, name) for v in judged]).reshape(-1, 3).T
        statements[name] = reliability(stated, right > 0.0, expected)
    return Summary(
        robot=name_of(robot),
        sensors=sensors,
        noise=noise,
        samples=len(verdicts),
        no_answer=1.0 - len(judged) / len(verdicts),
        statements=statements,
        region=Share.of(sum(v.in_region for v in judged), len(verdicts)),
        ellipse=Share.of(sum(ellipses), len(ellipses)),
        listed=float(np.mean([v.listed for v in judged])) if judged else float("nan"),
    )


def plain(summary: Summary) -> dict[str, Any]:
    """Numbers for JSON."""
    numbers = summary._asdict()
    numbers["noise"] = summary.noise._asdict()
    numbers["statements"] = {name: value.as_json() for name, value in summary.statements.items()}
    for name in ("region", "ellipse"):
        numbers |= {
            f"{name}{part}": value for part, value in zip(("", "_low", "_high"), numbers[name], strict=True)
        }
    return {
        key: None if isinstance(value, float) and np.isnan(value) else value for key, value in numbers.items()
    }


def print_summary(results: Sequence[Summary], what: str, second: str = "sensors") -> None:
    """Print one row for each case; `second`: heading of the column of `Summary.sensors`."""
    table = Table(
        title=f"calibration, {what}",
        caption=(
            "calibration error of the stated probabilities, in brackets what it is if the truths are "
            "distributed as stated, on average and at most in 19 of 20 cases; region, ellipse: share of the "
            "truths in those of 90 %, with its 95 % interval; listed: sum of the listed probabilities"
        ),
    )
    for name in ("arm", second, "noise N / Nm / Nm"):
        table.add_column(name, no_wrap=True)
    for name in (*STATEMENTS, "region", "ellipse", "listed", "no answer"):
        table.add_column(name, justify="right", no_wrap=True)
    for r in results:
        table.add_row(
            r.robot,
            r.sensors,
            str(r.noise),
            *(
                f"{100 * s.error:.1f} ({100 * s.by_chance:.1f}, {100 * s.by_chance_95:.1f}) %"
                for s in r.statements.values()
            ),
            str(r.region),
            str(r.ellipse),
            *(f"{100 * share:.1f} %" for share in (r.listed, r.no_answer)),
        )
    _console().print(table)


def _print_reliability(statement: str, results: Sequence[Summary]) -> None:
    table = Table(title=f"{statement}: stated -> right in %, and how many, by stated probability")
    for name in ("arm", "sensors", "noise"):
        table.add_column(name, no_wrap=True)
    edges = [(k / 10, (k + 1) / 10) for k in range(10)]
    for low, high in edges:
        table.add_column(f"{100 * low:.0f}-{100 * high:.0f}", justify="right")
    for r in results:
        cells = {
            round(entry.low, 1): f"{100 * entry.stated:.0f}->{100 * entry.right:.0f}\n{entry.samples}"
            for entry in r.statements[statement].bins
        }
        table.add_row(
            r.robot, r.sensors, f"{r.noise.torque:g} Nm", *(cells.get(round(low, 1), "") for low, _ in edges)
        )
    _console().print(table)


def _console() -> Console:
    return Console(width=176)
