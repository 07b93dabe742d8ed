"""All segments put together: contacts by robot and date, and a summary of each robot."""

import json
import shutil
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet

from contactsense.scene import Scene
from contactsense.service.analysis.contact_table import SCHEMA, replace_parquet
from contactsense.service.analysis.fleet.segment_task import SegmentTask, part_path
from contactsense.service.analysis.health import TOO_LARGE


@dataclass
class RobotSummary:
    """What the recordings of one robot say."""

    robot: str
    """Its name in the dataset; empty where the dataset names none."""
    recordings: int = 0
    """Number of recordings."""
    hours: float = 0.0
    """Time recorded [h]."""
    contacts: int = 0
    """Number of contacts."""
    touched: int = 0
    """Samples with a contact."""
    samples: int = 0
    """All samples."""
    degraded: int = 0
    """Samples in which a sensor was missing, invalid or inconsistent, or the observers settled."""
    dates: list[str] = field(default_factory=list)
    """Date of each segment."""
    base_bias: list[list[float]] = field(default_factory=list)
    """Biases of the base wrench at the end of each segment [N, Nm]."""
    joint_bias: list[list[float]] = field(default_factory=list)
    """Biases of the joint torques at the end of each segment [Nm]."""
    base_ratio: list[list[float]] = field(default_factory=list)
    """Residuals of the base wrench without contact, in standard deviations, of each segment."""
    joint_ratio: list[list[float]] = field(default_factory=list)
    """The same of the joint torques."""

    @property
    def contacts_per_hour(self) -> float:
        """Contacts in an hour of recording."""
        return self.contacts / self.hours if self.hours > 0.0 else 0.0

    def worst_ratio(self, scene: Scene) -> float:
        """Largest of the median residuals, in standard deviations."""
        known = []
        if scene.base_wrench is not None:
            known.append(np.median(self.base_ratio, axis=0))
        if scene.joint_torque is not None:
            known.append(np.median(self.joint_ratio, axis=0))
        return float(np.max(np.concatenate(known))) if self.base_ratio else 0.0

    def needs_calibration(self, scene: Scene) -> bool:
        """Whether residuals without contact are larger than noise and model allow."""
        return self.worst_ratio(scene) > TOO_LARGE


@dataclass(frozen=True)
class FleetSummary:
    """What a whole dataset says."""

    scene: Scene
    """The scene it was analysed with."""
    robots: tuple[RobotSummary, ...]
    """Each robot."""
    contacts: pa.Table
    """All contacts, with the columns `robot` and `date` in front."""
    problems: tuple[str, ...]
    """Recordings that were skipped or are doubtful, a sentence each."""
    skipped: int
    """Number of recordings that were skipped."""

    def __repr__(self) -> str:
        hours = sum(robot.hours for robot in self.robots)
        return f"<fleet: {len(self.robots)} robots, {hours:.1f} h, {self.contacts.num_rows} contacts>"

    @property
    def expected_false_alarms(self) -> float:
        """How many contacts noise alone may have made, by what the scene allows."""
        return self.scene.false_alarms_per_hour * sum(robot.hours for robot in self.robots)


def summarize(scene: Scene, tasks: Iterable[SegmentTask], results: Iterable[dict[str, Any]]) -> FleetSummary:
    """Put the results of all segments together; a contact that two neighbouring segments have seen counts
    once.

    Args:
        scene: The scene.
        tasks: The segments, those of a recording one after the other.
        results: What `run_segment` gave for each.
    """
    robots: dict[str, RobotSummary] = {}
    problems: list[str] = []
    tables: list[pa.Table] = []
    seen: dict[str, int] = defaultdict(int)
    over: dict[str, float] = {}
    skipped = set()
    for task, result in zip(tasks, results, strict=True):
        name = result["name"]
        if "problem" in result:
            if name not in skipped:
                problems.append(result["problem"])
            skipped.add(name)
            continue
        problems += [f"{name}: {text}" for text in result["problems"] if result["index"] == 0]
        table = pa_parquet.read_table(part_path(task).with_suffix(".parquet"))
        begin = table["begin"].to_numpy()
        end = begin + table["duration"].to_numpy()
        kept = np.flatnonzero(begin > over.get(name, -np.inf))
        over[name] = max([over.get(name, -np.inf), *end[kept].tolist()])
        table = table.take(kept)
        numbers = pa.array(np.arange(len(kept)) + seen[name] + 1, pa.int64())
        seen[name] += len(kept)
        table = table.set_column(table.schema.get_field_index("contact"), "contact", numbers)
        for i, key in enumerate(("robot", "date")):
            table = table.add_column(i, key, pa.array([result[key]] * len(kept), pa.string()))
        tables.append(table)
        robot = robots.setdefault(result["robot"], RobotSummary(result["robot"]))
        robot.recordings += result["index"] == 0
        robot.hours += (result["end"] - result["begin"]) / 3600.0
        robot.contacts += len(kept)
        for key in ("touched", "samples", "degraded"):
            setattr(robot, key, getattr(robot, key) + result[key])
        robot.dates.append(result["date"])
        for key in ("base_bias", "joint_bias", "base_ratio", "joint_ratio"):
            getattr(robot, key).append(result[key])
    schema = pa.schema([("robot", pa.string()), ("date", pa.string()), *SCHEMA])
    contacts = pa.concat_tables(tables) if tables else schema.empty_table()
    ordered = tuple(robots[name] for name in sorted(robots))
    return FleetSummary(scene, ordered, contacts, tuple(problems), len(skipped))


def write_summary(summary: FleetSummary, folder: Path) -> None:
    """Write the contacts as a hive dataset `contacts/robot=NAME/date=DATE/`, and `robots.parquet`."""
    target, fresh = folder / "contacts", folder / ".contacts"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    keys = set(zip(summary.contacts["robot"].to_pylist(), summary.contacts["date"].to_pylist(), strict=True))
    robot, date = summary.contacts["robot"].to_numpy(), summary.contacts["date"].to_numpy()
    for one, day in sorted(keys):
        here = fresh / f"robot={one or 'unknown'}" / f"date={day or 'unknown'}"
        here.mkdir(parents=True)
        part = summary.contacts.take(np.flatnonzero((robot == one) & (date == day)))
        replace_parquet(part.drop_columns(["robot", "date"]), here / "part-0.parquet")
    shutil.rmtree(target, ignore_errors=True)
    fresh.rename(target)
    replace_parquet(robot_table(summary), folder / "robots.parquet")


def robot_table(summary: FleetSummary) -> pa.Table:
    """One row per robot."""
    return pa.Table.from_pylist([robot_row(robot, summary.scene) for robot in summary.robots])


def robot_row(robot: RobotSummary, scene: Scene) -> dict[str, Any]:
    """One robot as plain numbers; drifts are those from its first segment to its last."""
    order = np.argsort(robot.dates, kind="stable")
    base, joint = np.array(robot.base_bias)[order], np.array(robot.joint_bias)[order]
    return {
        "robot": robot.robot,
        "recordings": robot.recordings,
        "hours": robot.hours,
        "contacts": robot.contacts,
        "contacts_per_hour": robot.contacts_per_hour,
        "touched": robot.touched / max(robot.samples, 1),
        "degraded": robot.degraded / max(robot.samples, 1),
        "base_bias_drift": (base[-1] - base[0]).tolist(),
        "joint_bias_drift": (joint[-1] - joint[0]).tolist(),
        "residual_ratio": robot.worst_ratio(scene),
        "needs_calibration": robot.needs_calibration(scene),
    }


def settings_of(scene: Path) -> str:
    """What the results depend on beside the recordings: the scene as it is read."""
    return json.dumps(Scene.load(scene).model_dump(mode="json"), sort_keys=True)
