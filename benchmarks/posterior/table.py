"""Comparison of our answers with the best possible ones: errors, link decisions and time as ratios to the
dense posterior's."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from rich.table import Table

from contactsense import Scene
from contactsense.benchmarks.peers.cases import Case, Score, answer, cases, errors, score
from contactsense.benchmarks.peers.method import Located
from contactsense.benchmarks.posterior.bootstrap import Ratio, ratio
from contactsense.benchmarks.posterior.dense import Dense, Geometry, Rule
from contactsense.benchmarks.posterior.samples import Samples, of_meshes, of_primitives
from contactsense.benchmarks.static_truth.cases import COLUMNS, Detail, Noise
from contactsense.benchmarks.static_truth.points import StaticPoints

AMBIGUOUS = 0.05
"""An answer is ambiguous if this much of the probability is on other links."""


@dataclass(frozen=True, slots=True)
class Row:
    """Our answers and those of the dense posterior for one case."""

    robot: str
    sensors: str
    noise: Noise
    contacts: int
    ours: Score
    dense: dict[Geometry, Score]
    ambiguous: dict[Geometry, float]
    median: dict[Geometry, Ratio]
    """Ratio of our median error to that of the dense posterior."""
    p95: dict[Geometry, Ratio]
    """The same for the 95 % quantile."""

    def as_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "robot": self.robot,
            "sensors": self.sensors,
            "noise": self.noise._asdict(),
            "contacts": self.contacts,
            "ours": self.ours._asdict(),
            "dense": {geometry: best._asdict() for geometry, best in self.dense.items()},
            "ambiguous": self.ambiguous,
            "median_ratio": {geometry: found._asdict() for geometry, found in self.median.items()},
            "p95_ratio": {geometry: found._asdict() for geometry, found in self.p95.items()},
        }


@dataclass(frozen=True, slots=True)
class Skins:
    """Dense samples of one arm, generated once for all cases."""

    samples: dict[Geometry, Samples]

    @classmethod
    def of(cls, robot: str, detail: Detail, meshes: Path, geometries: Sequence[Geometry]) -> "Skins":
        """Sample an arm: its primitives at the level of `detail`, its meshes from folder ROBOT."""
        scene = Scene(robot=robot, detail="coarse" if detail == "coarse" else "fine")
        samples: dict[Geometry, Samples] = {}
        for geometry in geometries:
            meshed = geometry == "meshes"
            samples[geometry] = of_meshes(scene, meshes / robot) if meshed else of_primitives(scene)
        return cls(samples)


def rows(
    points: StaticPoints,
    sensors: Sequence[str],
    detail: Detail,
    meshes: Path,
    skins: Skins,
    columns: Sequence[Noise] = COLUMNS,
    rule: Rule = "middle",
) -> Iterator[Row]:
    """Compare for all cases of some contacts; `rule` selects the point estimate of the dense posterior."""
    for case in cases(points, columns, sensors, detail, meshes):
        yield compare(case, skins, rule)


def compare(case: Case, skins: Skins, rule: Rule = "middle") -> Row:
    """Compare both methods on one case."""
    found, seconds = answer(Located(case.scene), case)
    dense: dict[Geometry, Score] = {}
    ambiguous: dict[Geometry, float] = {}
    median: dict[Geometry, Ratio] = {}
    p95: dict[Geometry, Ratio] = {}
    ours = errors(found, case.points)
    for geometry, samples in skins.samples.items():
        answers, time = answer(Dense(case.scene, geometry, samples, rule), case)
        dense[geometry] = score(answers, case.points, time)
        best = errors(answers, case.points)
        median[geometry], p95[geometry] = ratio(ours, best, 0.5), ratio(ours, best, 0.95)
        assert answers.link_probability is not None
        ambiguous[geometry] = float((answers.link_probability.max(axis=1) < 1.0 - AMBIGUOUS).mean())
    return Row(
        robot=case.points.robot,
        sensors=case.sensors,
        noise=case.noise,
        contacts=len(case.q),
        ours=score(found, case.points, seconds),
        dense=dense,
        ambiguous=ambiguous,
        median=median,
        p95=p95,
    )


def table(found: Sequence[Row], geometry: Geometry, detail: Detail) -> Table:
    """One row per case."""
    contacts = found[0].contacts
    result = Table(
        title=f"ours ({detail}) beside the dense posterior on {geometry}, {contacts} contacts an arm",
        caption=(
            "error median / 95 % in mm, failures included, and ours to the dense posterior's with the 95 % "
            "bootstrap interval; points: our link decisions less the dense posterior's; time: "
            f"of one of its answers; ambiguous: over {100 * AMBIGUOUS:.0f} % of its probability lies on "
            "other links"
        ),
    )
    for name in ("arm", "sensors", "noise N / Nm / Nm"):
        result.add_column(name, no_wrap=True)
    for name in (
        "ours: link",
        "error",
        "dense: link",
        "error",
        "ambiguous",
        "ratio: median",
        "95 %",
        "points",
        "time: dense",
        "ratio",
    ):
        result.add_column(name, justify="right", no_wrap=True)
    for row in found:
        best = row.dense[geometry]
        result.add_row(
            row.robot,
            row.sensors,
            str(row.noise),
            f"{100 * row.ours.link_right:.1f} %",
            _mm(row.ours),
            f"{100 * best.link_right:.1f} %",
            _mm(best),
            f"{100 * row.ambiguous[geometry]:.1f} %",
            str(row.median[geometry]),
            str(row.p95[geometry]),
            f"{100 * (row.ours.link_right - best.link_right):+.1f}",
            f"{1e3 * best.seconds:.1f} ms",
            f"1/{best.seconds / row.ours.seconds:.0f}",
        )
    return result


def _mm(found: Score) -> str:
    return f"{1e3 * found.median:.2f} / {1e3 * found.p95:.1f}"


GEOMETRIES: tuple[Geometry, ...] = get_args(Geometry)
