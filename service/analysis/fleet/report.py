"""The report on a dataset: one HTML file that needs no internet connection, and the same as Markdown."""

import json
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from contactsense.robots.files.whole_file import write_text
from contactsense.scene import Scene
from contactsense.service.analysis.assumptions import assumptions
from contactsense.service.analysis.fleet.drawn_arms import drawn_arms, members
from contactsense.service.analysis.fleet.drift import Daily
from contactsense.service.analysis.fleet.segments import UNKNOWN
from contactsense.service.analysis.fleet.summary import FleetSummary, RobotSummary, robot_rows
from contactsense.service.analysis.health import UNJUDGED
from contactsense.service.analysis.present_sensors import without_sensors
from contactsense.service.analysis.report import render
from contactsense.service.analysis.summary.undetermined_forces import silent_sensors, undetermined_forces
from contactsense.service.drawing.arm_scene import view_script
from contactsense.service.drawing.drift_svg import drift_chart
from contactsense.service.drawing.palette import link_colour

FORCES = (0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, float("inf"))
"""Bounds of the force classes [N]."""
MOST_CHARTS = 30
"""Maximum number of robots whose drift is drawn: those with the largest. The table lists all."""
MOST_PROBLEMS = 100
"""Maximum number of problems that are listed."""
_CALIBRATION = {True: "needed", False: "fits", None: "unknown"}


def write_fleet_report(summary: FleetSummary, folder: Path) -> None:
    """Write `fleet.html` and `fleet.md` into a folder, each whole or not at all.

    Raises:
        OSError: a file cannot be written.
    """
    content = _content(summary)
    write_text(folder / "fleet.html", render("fleet.html.j2", content))
    write_text(folder / "fleet.md", render("fleet.md.j2", content))


def _content(summary: FleetSummary) -> dict[str, Any]:
    table = summary.contacts
    hours = sum(robot.hours for robot in summary.robots)
    links = Counter(name or "no single place" for name in table["link"].to_pylist())
    force = table["peak_force"].to_numpy()
    counts = [int(np.sum((force >= low) & (force < high))) for low, high in pairwise(FORCES)]
    names = [
        f"{low:g} to {high:g} N" if np.isfinite(high) else f"above {low:g} N"
        for low, high in pairwise(FORCES)
    ]
    most = max([*counts, 1])
    order = {
        name: i for robot in summary.robots for i, name in reversed([*enumerate(robot.scene.link_names)])
    }
    arms = drawn_arms(summary)
    # They come first: no contacts of such a recording does not mean that nothing touched the arm.
    problems = [*(f"{name}: {UNJUDGED}" for name in summary.unjudged), *summary.problems]
    return {
        "summary": summary,
        "when": _when({day for robot in summary.robots for day in robot.dates}),
        "recordings": sum(robot.recordings for robot in summary.robots),
        "hours": _hours(hours),
        "rate": _rate(table.num_rows, hours),
        "robots": _table(summary),
        "charts": _charts(summary),
        "links": [
            (name, link_colour(order.get(name, -1)), count, _rate(count, hours))
            for name, count in links.most_common()
        ],
        "forces": list(zip(names, counts, [100.0 * c / most for c in counts], strict=True)),
        "doubtful": sum(robot.contacts for robot in summary.robots if robot.needs_calibration()),
        "false_alarms": f"{summary.expected_false_alarms:.3g}",
        "problems": problems[:MOST_PROBLEMS],
        "more_problems": max(len(problems) - MOST_PROBLEMS, 0),
        "arms": [(arm.name, members(arm.robots)) for arm in arms],
        "assumptions": _assumed(summary),
        "undetermined": fleet_undetermined_forces(summary),
        "script": view_script(),
        "data": json.dumps(
            [{"geometry": arm.geometry, "view": arm.view(summary.contacts)} for arm in arms],
            separators=(",", ":"),
        ),
    }


def _joint_names(scene: Scene) -> list[str]:
    return [joint.name.removesuffix("_joint") for joint in scene.robot.joints]


def fleet_undetermined_forces(summary: FleetSummary) -> list[tuple[str, str]]:
    """Robots with forces that their sensors do not determine, and what their forces mean."""
    found: dict[tuple[str, str], list[RobotSummary]] = {}
    for robot in summary.robots:
        whole = undetermined_forces(robot.scene)
        texts = [("", whole)]
        for absent in sorted(robot.absent, key=sorted):
            # Said of the whole robot already where the scene does not determine them either.
            text = undetermined_forces(without_sensors(robot.scene, absent))
            texts += [(f", recordings without {' and '.join(sorted(absent))}", text)] if text != whole else []
        texts.append(("", silent_sensors(summary.contacts.filter(pc.field("robot") == robot.robot))))
        for key in texts:
            found.setdefault(key, []).append(robot)
    return [(members(robots) + part, text) for (part, text), robots in found.items() if text]


def _assumed(summary: FleetSummary) -> list[str]:
    """The assumptions of all scenes, one sentence each; those that not all robots share name theirs."""
    found: dict[str, list[RobotSummary]] = {}
    for robot in summary.robots:
        for text in assumptions(robot.scene):
            found.setdefault(text, []).append(robot)
    everyone = len(summary.robots)
    shared = [text for text, robots in found.items() if len(robots) == everyone]
    return shared + [f"{members(robots)}: {text}" for text, robots in found.items() if len(robots) < everyone]


def _when(dates: set[str]) -> str:
    """The days of the recordings, in words that follow their number."""
    days = len(dates - {UNKNOWN})
    known = f" on {days} day{'' if days == 1 else 's'}" if days else ""
    return known + (f"{' and' if days else ''} of unknown date" if UNKNOWN in dates else "")


def _percent(share: float | None) -> str:
    return "unknown" if share is None else f"{100.0 * share:.1f} %"


def _hours(hours: float) -> str:
    return f"{hours:.2f}" if hours >= 0.1 or not hours else f"{hours:.2g}"  # of a single short recording


def _rate(count: int, hours: float) -> str:
    return f"{count / hours:.2f}" if hours else "unknown"


def _table(summary: FleetSummary) -> list[dict[str, Any]]:
    joints = {robot.robot: _joint_names(robot.scene) for robot in summary.robots}
    return [_robot(row, joints.get(row["robot"], [])) for row in robot_rows(summary)]


def _robot(row: dict[str, Any], joints: list[str]) -> dict[str, Any]:
    base, joint = _largest(row["base_bias_drift"][:3]), _largest(row["joint_bias_drift"])
    moment = _largest(row["base_bias_drift"][3:])
    coulomb = _largest(row["coulomb_drift"])
    worst = "" if coulomb is None else f", {joints[row['coulomb_drift'].index(coulomb)]}"
    return {
        "robot": row["robot"],
        "recordings": row["recordings"],
        "hours": _hours(row["hours"]),
        "contacts": row["contacts"],
        "rate": _rate(row["contacts"], row["hours"]),
        "touched": _percent(row["touched"]),
        "degraded": _percent(row["degraded"]),
        "base_drift": f"{_text(base, 'N')}, {_text(moment, 'Nm', 3)}",
        "joint_drift": _text(joint, "Nm"),
        "friction_drift": _text(coulomb, "Nm") + worst,
        "ratio": "unknown" if row["residual_ratio"] is None else f"{row['residual_ratio']:.2f}",
        "calibration": _CALIBRATION[row["needs_calibration"]] if row["has_scene"] else "no scene",
    }


def _largest(values: list[float | None]) -> float | None:
    """The value of largest magnitude."""
    return max((x for x in values if x is not None), key=abs, default=None)


def _text(value: float | None, unit: str, digits: int = 2) -> str:
    return "unknown" if value is None else f"{value:+z.{digits}f} {unit}"


def _charts(summary: FleetSummary) -> list[tuple[str, str, str]]:
    """Name, friction chart and joint-bias chart of the robots that drift most; a chart is empty if nothing is
    known."""
    charts = []
    for robot in summary.robots:
        coulomb, bias = robot.friction_by_day()[0].dated, robot.bias_by_day()[1].dated
        if len(bias.dates) < 2:
            continue
        name = robot.robot
        joints = _joint_names(robot.scene)
        largest = max([0.0, *np.abs(coulomb.drift[np.isfinite(coulomb.drift)])])
        friction = _chart(coulomb, joints, f"Coulomb friction of {name} beyond the scene's")
        biases = _chart(bias, joints, f"biases of the joint torques of {name}")
        charts.append((largest, name, friction, biases))
    charts.sort(key=lambda chart: -chart[0])
    return [chart[1:] for chart in charts[:MOST_CHARTS]]


def _chart(daily: Daily, joints: Sequence[str], title: str) -> str:
    """Torques of each joint over days; empty if none is known, as the friction of an arm at rest."""
    known = np.isfinite(daily.values).any()
    return drift_chart(daily.dates, daily.values, joints, "Nm", title) if known else ""
