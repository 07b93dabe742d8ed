"""`contactsense bench geometry MESHES --links`: the fine primitives of each link against its skin, and why a
link is beyond the limit."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense.robots import Link, Robot

if TYPE_CHECKING:
    from contactsense.robots.decomposition.surface_error import Errors

LIMIT = 0.002
"""Wanted 95th percentile of the distance, both ways [m]."""

NOTABLE = 0.01
"""Smallest share of the skin that is part of a reason."""


def measure_links(robot: Robot, folder: Path) -> list[dict[str, Any]]:
    """One row for each link of an arm; lengths in mm.

    Args:
        robot: The arm.
        folder: Folder of its meshes.
    """
    from contactsense.robots.decomposition.distance_samples import Shape
    from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
    from contactsense.robots.decomposition.outer_skin import Surroundings, outer_skin
    from contactsense.robots.decomposition.surface_error import bodies_of, errors
    from contactsense.robots.urdf.meshes import from_folder

    meshes = from_folder(folder, robot.link_names)
    rows: list[dict[str, Any]] = []
    for number, link in enumerate(robot.links):
        # The seed differs from that of the fit: other samples of the same skin.
        poses = neighbour_poses(robot, meshes, number, seed=1)
        skin = outer_skin(meshes[link.name], poses, seed=1)
        around = Surroundings(meshes[link.name], poses)
        found = errors(bodies_of(link.primitives), skin, Shape(skin), around, seed=1)
        points = skin.points[skin.exposure > 0.0]
        rows.append({"robot": robot.name, "link": link.name} | link_row(link, found, points))
    return rows


def link_row(link: Link, found: "Errors", points: np.ndarray) -> dict[str, Any]:
    """What was measured of one link.

    Args:
        link: With its fine primitives.
        found: Distances between its skin and these.
        points: The samples of the skin, link frame, shape (N, 3) [m].
    """
    return {
        "primitives": len(link.primitives),
        "skin_to_model_p95_mm": _p95_mm(found.skin),
        "model_to_skin_p95_mm": _p95_mm(found.primitive),
        "reason": reason(found.skin, found.primitive, points),
    }


def _p95_mm(distances: np.ndarray) -> float | None:
    """95th percentile of their magnitudes [mm]; None without any, as where no primitive is exposed."""
    return round(1e3 * float(np.percentile(np.abs(distances), 95.0)), 2) if len(distances) else None


def reason(skin: np.ndarray, primitive: np.ndarray, points: np.ndarray) -> str:
    """Why a link is beyond the limit, empty if it is within.

    Args:
        skin: Distances of skin from the primitives, positive where they are below it, shape (N,) [m].
        primitive: Distances of the primitives' exposed surface from the skin, shape (M,) [m].
        points: The samples of the skin, link frame, shape (N, 3) [m].
    """
    if max(np.percentile(np.abs(part), 95.0) for part in (skin, primitive) if len(part)) <= LIMIT:
        return ""
    parts = []
    for beyond, text in ((skin < -LIMIT, "below the primitives"), (skin > LIMIT, "above the primitives")):
        if beyond.mean() >= NOTABLE:
            x, y, z = np.round(1e3 * np.median(points[beyond], axis=0)).astype(int)
            parts.append(
                f"{100.0 * beyond.mean():.0f} % of the skin is {text}, up to "
                f"{1e3 * np.abs(skin[beyond]).max():.1f} mm, about ({x}, {y}, {z}) mm"
            )
    if (primitive > LIMIT).any():
        parts.append(
            f"{100.0 * (primitive > LIMIT).mean():.0f} % of the primitives' surface has no skin near"
        )
    return "; ".join(parts)


def print_links(rows: list[dict[str, Any]]) -> None:
    """Print the links of all arms as a table."""
    table = Table(box=box.SIMPLE_HEAD, title="95 % of the distances, mm")
    for heading in ("arm", "link", "primitives", "skin to model", "model to skin", "beyond 2 mm because"):
        left = heading in ("arm", "link", "beyond 2 mm because")
        table.add_column(heading, justify="left" if left else "right", overflow="fold")
    for row in rows:
        found = (row[key] for key in ("skin_to_model_p95_mm", "model_to_skin_p95_mm"))
        lengths = ("not exposed" if length is None else f"{length:.2f}" for length in found)
        table.add_row(row["robot"], row["link"], str(row["primitives"]), *lengths, row["reason"])
    Console(width=132).print(table)
