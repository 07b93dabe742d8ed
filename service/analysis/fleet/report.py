"""The report on a dataset: one HTML file that needs no internet, and the same as Markdown."""

import json
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from contactsense.scene import Scene
from contactsense.service.analysis.assumptions import assumptions
from contactsense.service.analysis.fleet.summary import FleetSummary, robot_row
from contactsense.service.analysis.report import render
from contactsense.service.analysis.summarize import Summarizer
from contactsense.service.drawing.arm_scene import arm_geometry, arm_view, view_script
from contactsense.service.drawing.palette import link_colour

FORCES = (0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, float("inf"))
"""Classes of forces [N]."""
MOST_DOTS = 3000
"""Most places that are drawn on the arm; of more, every so manieth."""


def write_fleet_report(summary: FleetSummary, folder: Path) -> None:
    """Write `fleet.html` and `fleet.md` into a folder."""
    content = _content(summary)
    (folder / "fleet.html").write_text(render("fleet.html.j2", content), encoding="utf-8")
    (folder / "fleet.md").write_text(render("fleet.md.j2", content), encoding="utf-8")


def _content(summary: FleetSummary) -> dict[str, Any]:
    scene, table = summary.scene, summary.contacts
    hours = sum(robot.hours for robot in summary.robots)
    links = Counter(name or "no single place" for name in table["link"].to_pylist())
    force = table["peak_force"].to_numpy()
    counts = [int(np.sum((force >= low) & (force < high))) for low, high in pairwise(FORCES)]
    names = [
        f"{low:g} to {high:g} N" if np.isfinite(high) else f"above {low:g} N"
        for low, high in pairwise(FORCES)
    ]
    most = max([*counts, 1])
    order = {name: i for i, name in enumerate(scene.link_names)}
    return {
        "summary": summary,
        "hours": f"{hours:.2f}",
        "rate": f"{table.num_rows / hours:.2f}" if hours else "0",
        "robots": [_robot(robot_row(robot, scene)) for robot in summary.robots],
        "links": [
            (name, link_colour(order.get(name, -1)), count, f"{count / hours:.2f}" if hours else "0")
            for name, count in links.most_common()
        ],
        "forces": list(zip(names, counts, [100.0 * c / most for c in counts], strict=True)),
        "false_alarms": f"{summary.expected_false_alarms:.3g}",
        "assumptions": assumptions(scene),
        "script": view_script(),
        "data": json.dumps({"geometry": arm_geometry(scene), "view": _dots(summary)}, separators=(",", ":")),
    }


def _robot(row: dict[str, Any]) -> dict[str, Any]:
    base, joint = np.abs(row["base_bias_drift"]), np.abs(row["joint_bias_drift"])
    return {
        "robot": row["robot"] or "unknown",
        "recordings": row["recordings"],
        "hours": f"{row['hours']:.2f}",
        "contacts": row["contacts"],
        "rate": f"{row['contacts_per_hour']:.2f}",
        "touched": f"{100.0 * row['touched']:.1f} %",
        "degraded": f"{100.0 * row['degraded']:.1f} %",
        "base_drift": f"{base[:3].max():.2f} N, {base[3:].max():.3f} Nm",
        "joint_drift": f"{joint.max():.2f} Nm",
        "ratio": f"{row['residual_ratio']:.2f}",
        "calibrate": row["needs_calibration"],
    }


def _dots(summary: FleetSummary) -> dict[str, Any]:
    """The arm in the posture of the first contact with the places of all contacts, coloured by force."""
    scene, table = summary.scene, summary.contacts
    q = np.array(table["q"][0].as_py()) if table.num_rows else np.zeros(len(scene.robot.joints))
    frames = Summarizer(scene)
    poses = [frames.link_pose(q, link) for link in range(len(scene.link_names))]
    view = arm_view(poses, _up(scene))
    rows = np.flatnonzero(table["link_index"].to_numpy() >= 0)
    rows = rows[:: -(-max(len(rows), 1) // MOST_DOTS)]
    part = table.take(rows)
    place = np.column_stack([part[f"point_{a}"].to_numpy() for a in "xyz"]).reshape(-1, 3)
    dots = []
    for link, point, force in zip(
        part["link_index"].to_pylist(), place, part["peak_force"].to_pylist(), strict=True
    ):
        origin, rotation = poses[link]
        dots += [*(1e3 * (origin + rotation @ point)).round(1).tolist(), round(min(force / 100.0, 1.0), 3)]
    view["dots"] = dots
    return view


def _up(scene: Scene) -> np.ndarray:
    return np.asarray(-scene.gravity_base / np.linalg.norm(scene.gravity_base))
