"""Results of all segments combined: contacts by robot and date, and a summary of each robot."""

import json
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.scene import Scene
from contactsense.service.analysis.contact_table import SCHEMA
from contactsense.service.analysis.fleet.drift import Daily, daily_mean, daily_median
from contactsense.service.analysis.fleet.segment_problems import RecordingProblems
from contactsense.service.analysis.fleet.segment_task import FRICTION, SegmentTask, part_path, without_nan
from contactsense.service.analysis.health import TOO_LARGE
from contactsense.service.recordings.metadata import plain
from contactsense.service.recordings.tables.parquet_files import write_parquet


@dataclass
class RobotSummary:
    """Summary of one robot's recordings."""

    robot: str
    """Its name in the dataset, see `contactsense.service.analysis.fleet.segments.DatasetFile`."""
    scene: Scene
    """The scene it was analysed with."""
    recordings: int = 0
    """Number of recordings."""
    hours: float = 0.0
    """Time recorded, without gaps and without segments that have no usable sample [h]."""
    contacts: int = 0
    """Number of contacts."""
    touched: int = 0
    """Samples with a contact."""
    samples: int = 0
    """All samples."""
    degraded: int = 0
    """Samples in which a sensor was missing, invalid or inconsistent, or the observers were settling."""
    absent: set[frozenset[str]] = field(default_factory=set)
    """Fields of the scene's sensors that recordings lack, for each recording; empty: none."""
    dates: list[str] = field(default_factory=list)
    """Date of each segment."""
    free: list[int] = field(default_factory=list)
    """Usable samples without contact in each segment."""
    base_bias: list[list[float | None]] = field(default_factory=list)
    """Biases of the base wrench at the end of each segment [N, Nm]; None if it has no usable sample."""
    joint_bias: list[list[float | None]] = field(default_factory=list)
    """Biases of the joint torques at the end of each segment [Nm]; None likewise."""
    joint_constant: list[list[float | None]] = field(default_factory=list)
    """The same over the whole segment, separated from friction; None if unknown."""
    base_ratio: list[list[float | None]] = field(default_factory=list)
    """Residuals of the base wrench without contact in each segment, in standard deviations; None if its
    recording lacks the sensor."""
    joint_ratio: list[list[float | None]] = field(default_factory=list)
    """The same of the joint torques."""
    coulomb: list[list[float | None]] = field(default_factory=list)
    """Coulomb friction beyond the scene's in each segment [Nm], None if unknown."""
    viscous: list[list[float | None]] = field(default_factory=list)
    """The same of viscous friction [Nm s/rad]."""
    coulomb_std: list[list[float | None]] = field(default_factory=list)
    """Standard deviations of the Coulomb part [Nm]."""
    viscous_std: list[list[float | None]] = field(default_factory=list)
    """The same of the viscous part [Nm s/rad]."""
    day_hours: dict[str, float] = field(default_factory=dict)
    """The same on each day [h]."""
    day_contacts: dict[str, int] = field(default_factory=dict)
    """Contacts of each day."""

    def bias_by_day(self) -> tuple[Daily, Daily]:
        """Biases of base wrench [N, Nm] and joint torques [Nm], the median of each day."""
        joints = len(self.scene.robot.joints)
        constant, end = (
            daily_median(self.dates, rows, joints) for rows in (self.joint_constant, self.joint_bias)
        )
        # At the end of a segment, a bias contains some friction. For a joint that never moves, it is the only
        # value.
        known = np.isfinite(constant.values).any(axis=0)
        joint = Daily(end.dates, np.where(known, constant.values, end.values))
        return daily_median(self.dates, self.base_bias, 6), joint

    def friction_by_day(self) -> tuple[Daily, Daily]:
        """Coulomb [Nm] and viscous [Nm s/rad] friction beyond the scene's on each day."""
        joints = len(self.scene.robot.joints)
        return (
            daily_mean(self.dates, self.coulomb, self.coulomb_std, joints),
            daily_mean(self.dates, self.viscous, self.viscous_std, joints),
        )

    @property
    def contacts_per_hour(self) -> float | None:
        """Contacts per hour of recording; None if there is no usable one."""
        return self.contacts / self.hours if self.hours > 0.0 else None

    def worst_ratio(self) -> float | None:
        """Largest of the median residuals, in standard deviations; None if no sample was free of contact."""
        medians = []
        for rows in (self.base_ratio, self.joint_ratio):
            # The ratio of a segment without a free sample is 0, which says nothing.
            known = [row for row, free in zip(rows, self.free, strict=True) if free and None not in row]
            if known:
                medians.append(np.median(np.array(known, dtype=float), axis=0))
        return float(np.max(np.concatenate(medians))) if medians else None

    def needs_calibration(self) -> bool | None:
        """Whether residuals without contact are larger than noise and model allow; None if unknown."""
        worst = self.worst_ratio()
        return None if worst is None else worst > TOO_LARGE


@dataclass(frozen=True)
class FleetSummary:
    """Summary of a whole dataset."""

    robots: tuple[RobotSummary, ...]
    """Each robot with a scene, also if none of its recordings can be read."""
    contacts: pa.Table
    """All contacts, with the additional first columns `robot` and `date`."""
    problems: tuple[str, ...]
    """Recordings that were skipped or are doubtful, one sentence each."""
    skipped: int
    """Number of recordings that were skipped."""
    unjudged: tuple[str, ...] = ()
    """Recordings without a usable sample: whether anything touched the arm is not known."""
    without_scene: tuple[str, ...] = ()
    """Robots whose recordings were skipped, as they have no scene that can be used."""

    def __repr__(self) -> str:
        hours = sum(robot.hours for robot in self.robots)
        return f"<fleet: {len(self.robots)} robots, {hours:.1f} h, {self.contacts.num_rows} contacts>"

    @property
    def expected_false_alarms(self) -> float:
        """Expected number of contacts caused by noise alone, from the scene's false-alarm rate."""
        return sum(robot.scene.false_alarms_per_hour * robot.hours for robot in self.robots)


def summarize(
    scenes: Mapping[str, Scene], tasks: Iterable[SegmentTask], results: Iterable[dict[str, Any]]
) -> FleetSummary:
    """Combine the results of all segments; a contact found in two neighbouring segments counts once.

    Args:
        scenes: The scene of each robot.
        tasks: The segments; those of one recording are consecutive.
        results: The result of `run_segment` for each.
    """
    robots: dict[str, RobotSummary] = {}
    problems: dict[str, RecordingProblems] = {}
    unreadable: dict[str, str] = {}
    tables: list[pa.Table] = []
    seen: dict[str, int] = defaultdict(int)  # contacts so far, by recording
    over: dict[str, int] = defaultdict(int)  # row at which the latest of them has ended
    judged: dict[str, bool] = {}
    for task, result in zip(tasks, results, strict=True):
        name, one, day = result["name"], result["robot"], result["date"]
        robot = robots.setdefault(one, RobotSummary(one, scenes[one]))
        if "problem" in result:
            unreadable.setdefault(name, result["problem"])
            continue
        problems.setdefault(name, RecordingProblems()).add(result)
        table = pa_parquet.read_table(part_path(task).with_suffix(".parquet"))
        kept = np.flatnonzero(table["row"].to_numpy() >= over[name])
        over[name] = max([over[name], *table["row_end"].to_numpy()[kept].tolist()])
        table = table.take(kept)
        numbers = pa.array(np.arange(len(kept)) + seen[name] + 1, pa.int64())
        seen[name] += len(kept)
        at = table.schema.get_field_index("contact")
        table = table.set_column(at, table.schema.field(at), numbers)
        for i, key in enumerate(("robot", "date")):
            table = table.add_column(i, key, pa.array([result[key]] * len(kept), pa.string()))
        tables.append(table)
        judged[name] = judged.get(name, False) or len(kept) > 0 or result["usable"] > 0
        hours = result["seconds"] / 3600.0
        robot.recordings += result["index"] == 0
        robot.hours += hours
        robot.contacts += len(kept)
        robot.day_hours[day] = robot.day_hours.get(day, 0.0) + hours
        robot.day_contacts[day] = robot.day_contacts.get(day, 0) + len(kept)
        for key in ("touched", "samples", "degraded"):
            setattr(robot, key, getattr(robot, key) + result[key])
        robot.absent.add(frozenset(result["absent"]))
        robot.dates.append(day)
        robot.free.append(result["free"])
        for key in ("base_bias", "joint_bias"):
            # Without a free sample, the bias filter has learnt nothing: its value is where it began.
            biases = result[key] if result["free"] else [None] * len(result[key])
            getattr(robot, key).append(biases)
        for key in ("base_ratio", "joint_ratio", "joint_constant", *FRICTION):
            getattr(robot, key).append(result[key])
    schema = pa.schema([("robot", pa.string()), ("date", pa.string()), *SCHEMA])
    contacts = pa.concat_tables(tables) if tables else schema.empty_table()
    ordered = tuple(robots[name] for name in sorted(robots))
    unjudged = tuple(name for name, known in judged.items() if not known)
    return FleetSummary(ordered, contacts, tuple(_sentences(problems, unreadable)), len(unreadable), unjudged)


def _sentences(problems: Mapping[str, RecordingProblems], unreadable: Mapping[str, str]) -> Iterator[str]:
    """Problems of all recordings by name, those that cannot be read first."""
    yield from unreadable.values()
    for name, found in problems.items():
        yield from (f"{name}: {text}" for text in found.lines())


def write_summary(summary: FleetSummary, folder: Path) -> None:
    """Write the contacts as a hive dataset `contacts/robot=NAME/date=DATE/`, `robots.parquet` and
    `days.parquet`."""
    target, fresh = folder / "contacts", folder / ".contacts"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    keys = set(zip(summary.contacts["robot"].to_pylist(), summary.contacts["date"].to_pylist(), strict=True))
    robot, date = summary.contacts["robot"].to_numpy(), summary.contacts["date"].to_numpy()
    for one, day in sorted(keys):
        here = fresh / f"robot={one}" / f"date={day}"
        here.mkdir(parents=True)
        part = summary.contacts.take(np.flatnonzero((robot == one) & (date == day)))
        write_parquet(part.drop_columns(["robot", "date"]), here / "part-0.parquet")
    shutil.rmtree(target, ignore_errors=True)
    fresh.rename(target)
    write_parquet(pa.Table.from_pylist(robot_rows(summary)), folder / "robots.parquet")
    rows = [row for robot in summary.robots for row in day_rows(robot)]
    write_parquet(pa.Table.from_pylist(rows), folder / "days.parquet")


def robot_rows(summary: FleetSummary) -> list[dict[str, Any]]:
    """One row for each robot, in the order of their names."""
    rows = [robot_row(robot) for robot in summary.robots]
    rows += [_row_without_scene(name) for name in summary.without_scene]
    return sorted(rows, key=lambda row: str(row["robot"]))


def _row_without_scene(name: str) -> dict[str, Any]:
    """As `robot_row`; joints are not known either, so the lists of them are empty."""
    return {
        "robot": name,
        "has_scene": False,
        "recordings": 0,
        "hours": 0.0,
        "contacts": 0,
        "contacts_per_hour": None,
        "touched": None,
        "degraded": None,
        "base_bias_drift": [None] * 6,
        "joint_bias_drift": [],
        "coulomb_drift": [],
        "viscous_drift": [],
        "residual_ratio": None,
        "needs_calibration": None,
    }


def robot_row(robot: RobotSummary) -> dict[str, Any]:
    """One robot as plain numbers, None if unknown; drifts are the trend from its first day to its last."""
    base, joint = robot.bias_by_day()
    coulomb, viscous = robot.friction_by_day()
    # Without a usable sample, it is not known what touched the arm.
    usable = robot.samples > 0 and robot.hours > 0.0
    return {
        "robot": robot.robot,
        "has_scene": True,
        "recordings": robot.recordings,
        "hours": robot.hours,
        "contacts": robot.contacts,
        "contacts_per_hour": robot.contacts_per_hour,
        "touched": robot.touched / robot.samples if usable else None,
        "degraded": robot.degraded / robot.samples if usable else None,
        "base_bias_drift": without_nan(base.drift),
        "joint_bias_drift": without_nan(joint.drift),
        "coulomb_drift": without_nan(coulomb.drift),
        "viscous_drift": without_nan(viscous.drift),
        "residual_ratio": robot.worst_ratio(),
        "needs_calibration": robot.needs_calibration(),
    }


def day_rows(robot: RobotSummary) -> list[dict[str, Any]]:
    """One row for each day of a robot: time, contacts, biases, friction beyond the scene's."""
    base, joint = robot.bias_by_day()
    coulomb, viscous = robot.friction_by_day()
    return [
        {
            "robot": robot.robot,
            "date": day,
            "hours": robot.day_hours[day],
            "contacts": robot.day_contacts[day],
            "base_bias": without_nan(base.values[i]),
            "joint_bias": without_nan(joint.values[i]),
            "coulomb": without_nan(coulomb.values[i]),
            "viscous": without_nan(viscous.values[i]),
        }
        for i, day in enumerate(base.dates)
    ]


def settings_of(scene: Scene) -> str:
    """The scene as text, with the arm and the sizes and times of meshes in files that it only names: what the
    results depend on in addition to the recordings."""
    meshes = [] if scene.meshes is None else sorted(Path(scene.meshes).glob("*"))
    files = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in meshes]
    described = {
        "scene": scene.model_dump(mode="json"),
        "arm": asdict(replace(scene.robot, file=None)),
        "meshes": files,
    }
    return json.dumps(described, sort_keys=True, default=plain)
