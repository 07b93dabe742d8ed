"""Comparison of the contacts found in a dataset with the simulated ones."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from contactsense.benchmarks.fleet.dataset import COULOMB, bias_drift, friction_drift
from contactsense.service.analysis.fleet.summary import FleetSummary, robot_row

TOLERANCE = 0.2
"""Tolerance for earlier starts and later ends of a contact, due to the low-pass [s]."""


def score_contacts(made: Sequence[dict[str, Any]], found: pa.Table) -> dict[str, Any]:
    """Number of contacts found, their links and errors, and number of false contacts.

    Args:
        made: Results of `contactsense.benchmarks.fleet.dataset.make_recording`.
        found: Contacts found by the analysis.
    """
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    names = ("robot", "recording", "begin", "duration", "link", "peak_force", "point_x", "point_y", "point_z")
    for row in found.select(list(names)).to_pylist():
        rows[row["recording"]].append(row | {"used": False})
    detected = right = 0
    errors, forces = [], []
    for contact in made:
        matches = [row for row in rows[contact["recording"]] if _overlap(row, contact)]
        for row in matches:
            row["used"] = True
        if not matches:
            continue
        detected += 1
        strongest = max(matches, key=lambda row: float(row["peak_force"]))
        forces.append(strongest["peak_force"] / contact["force"] - 1.0)
        if strongest["link"] == contact["link"]:
            right += 1
            place = np.array([strongest[f"point_{axis}"] for axis in "xyz"])
            errors.append(float(np.linalg.norm(place - contact["point"])))
    everything = [row for one in rows.values() for row in one]
    false = [row["robot"] for row in everything if not row["used"]]
    return {
        "made": len(made),
        "found": detected,
        "false": len(false),
        "false_by_robot": dict(sorted(Counter(false).items())),
        "split": sum(row["used"] for row in everything) - detected,
        "link_right": right / max(detected, 1),
        "median_mm": 1e3 * float(np.median(errors)) if errors else None,
        "p95_mm": 1e3 * float(np.percentile(errors, 95)) if errors else None,
        "force_error": float(np.median(np.abs(forces))) if forces else None,
    }


def score_drift(summary: FleetSummary) -> list[dict[str, Any]]:
    """Estimated drift and simulated drift, root mean square over the joints of each robot."""
    scores = []
    for robot in summary.robots:
        number = int(robot.robot.removeprefix("arm"))
        row = robot_row(robot)
        _, joint_bias = bias_drift(number)
        scores.append(
            {
                "robot": robot.robot,
                "contacts": robot.contacts,
                "needs_calibration": row["needs_calibration"],
                **_compare("coulomb", np.array(COULOMB) * friction_drift(number), row["coulomb_drift"]),
                **_compare("joint_bias", joint_bias, row["joint_bias_drift"]),
            }
        )
    return scores


def _compare(name: str, made: np.ndarray, found: list[float | None]) -> dict[str, float]:
    known = np.array([np.nan if x is None else x for x in found])
    return {
        f"{name}_made": float(np.sqrt(np.mean(made**2))),
        f"{name}_error": float(np.sqrt(np.nanmean((known - made) ** 2))),
    }


def _overlap(row: dict[str, Any], contact: dict[str, Any]) -> bool:
    begin, end = row["begin"], row["begin"] + row["duration"]
    return bool(begin < contact["end"] + TOLERANCE and end > contact["begin"] - TOLERANCE)
