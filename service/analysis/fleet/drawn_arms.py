"""The arms of a dataset as its report draws them: robots that look alike in one picture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from contactsense.scene import Scene
from contactsense.service.analysis.fleet.summary import FleetSummary, RobotSummary
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.drawing.arm_scene import arm_geometry, arm_view
from contactsense.service.drawing.palette import heat_colours
from contactsense.service.drawing.posture import usual_posture

MOST_DOTS = 3000
"""Maximum number of contact points drawn on an arm; of more, an evenly spaced subset is drawn."""
ALIKE = 0.02
"""Largest difference of mountings that are drawn in one picture [rad]."""
MOST_NAMES = 12
"""Maximum number of robots that are listed by name."""
DOT_FORCES = (1.0, 100.0)
"""Forces at the ends of the dots' colour scale [N]."""


@dataclass(frozen=True)
class DrawnArm:
    """Robots with the same surfaces, tool, pedestals and mounting."""

    name: str
    """Of arm and tool."""
    geometry: list[dict[str, str]]
    """Of `contactsense.service.drawing.arm_scene.arm_geometry`."""
    up: np.ndarray
    """Upward direction, base axes, shape (3,)."""
    robots: list[RobotSummary]
    """The robots."""

    def view(self, contacts: pa.Table) -> dict[str, Any]:
        """The arm in the posture of the robots' first contact, with the points of all of theirs, coloured by
        force; see `contactsense.service.drawing.arm_scene.arm_view`."""
        scene = self.robots[0].scene
        names = {robot.robot for robot in self.robots}
        own = contacts.take(np.flatnonzero([name in names for name in contacts["robot"].to_pylist()]))
        q = np.array(own["q"][0].as_py()) if own.num_rows else usual_posture(scene.robot)
        frames = Summarizer(scene)
        poses = [frames.link_pose(q, link) for link in range(len(scene.link_names))]
        return arm_view(poses, self.up) | {"dots": _dots(own, poses)}


def drawn_arms(summary: FleetSummary) -> list[DrawnArm]:
    """The arms to draw, in the order of the robots."""
    found: list[DrawnArm] = []
    for robot in summary.robots:
        scene = robot.scene
        name = scene.robot.name + (f" with {scene.tool.name}" if scene.tool is not None else "")
        geometry, up = arm_geometry(scene), _up(scene)
        for arm in found:
            if (arm.name, arm.geometry) == (name, geometry) and np.allclose(arm.up, up, atol=ALIKE):
                arm.robots.append(robot)
                break
        else:
            found.append(DrawnArm(name, geometry, up, [robot]))
    return found


def members(robots: list[RobotSummary]) -> str:
    """The names of robots in one line, of many the first ones and the number of the others."""
    names = [robot.robot for robot in robots]
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def _dots(contacts: pa.Table, poses: list[tuple[np.ndarray, np.ndarray]]) -> list[float | str]:
    """Place [mm] and colour of each contact, base frame, one after another."""
    rows = np.flatnonzero(contacts["link_index"].to_numpy() >= 0)
    part = contacts.take(rows[:: -(-max(len(rows), 1) // MOST_DOTS)])
    place = np.column_stack([part[f"point_{a}"].to_numpy() for a in "xyz"]).reshape(-1, 3)
    force = np.clip(part["peak_force"].to_numpy(), *DOT_FORCES)
    colours = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in heat_colours(force, *DOT_FORCES)]
    dots: list[float | str] = []
    for link, point, colour in zip(part["link_index"].to_pylist(), place, colours, strict=True):
        origin, rotation = poses[link]
        dots += [*(1e3 * (origin + rotation @ point)).round(1).tolist(), colour]
    return dots


def _up(scene: Scene) -> np.ndarray:
    return np.asarray(-scene.gravity_base / np.linalg.norm(scene.gravity_base))
