"""The arm in 3D as plain data for `arm_view.js`, which draws it in a browser without any library.

A copy of a 3D library would add 0.8 MB to every report; the arm's geometry is a tenth of that.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contactsense.scene import Scene
from contactsense.service.drawing.link_geometry import link_meshes
from contactsense.service.drawing.palette import link_colour

REGION_90 = 4.605
"""Squared Mahalanobis radius that contains 90 % of a two-dimensional Gaussian."""
ARROW_LENGTH = 0.25
"""Length of the longest arrow [m]."""


def view_script() -> str:
    """The JavaScript code for drawing: `drawArm(canvas, geometry, view)`."""
    return (Path(__file__).parent / "arm_view.js").read_text(encoding="utf-8")


def arm_geometry(scene: Scene) -> list[dict[str, Any]]:
    """Meshes of all links: `color`, `vertices` (link frame, mm) and `faces`, flat lists."""
    return [
        {
            "color": link_colour(i),
            "vertices": np.rint(1e3 * mesh.vertices).astype(int).ravel().tolist(),
            "faces": mesh.faces.ravel().tolist(),
        }
        for i, mesh in enumerate(link_meshes(scene))
    ]


def arm_view(
    poses: Sequence[tuple[np.ndarray, np.ndarray]],
    up: np.ndarray,
    point: np.ndarray | None = None,
    force: np.ndarray | None = None,
    region: np.ndarray | None = None,
) -> dict[str, Any]:
    """View of one posture, with a contact if there is one.

    Args:
        poses: Origin (3,) [m] and rotation (3, 3) of each link in the base frame.
        up: Upward direction in the picture, base axes, shape (3,).
        point: Contact point, base frame, shape (3,) [m].
        force: Force on the robot, base axes, shape (3,); only its direction is drawn.
        region: Outline of the credible region of the contact point, base frame, shape (K, 3) [m].
    """
    view: dict[str, Any] = {
        "poses": [[*(1e3 * o).round(2), *r.ravel().round(5)] for o, r in poses],
        "up": up.round(5).tolist(),
    }
    if point is not None and np.isfinite(point).all():
        view["point"] = (1e3 * point).round(2).tolist()
        size = 0.0 if force is None else float(np.linalg.norm(force))
        if force is not None and size > 0.0:
            view["arrow"] = (1e3 * (point - ARROW_LENGTH * force / size)).round(2).tolist()
        if region is not None:
            view["region"] = (1e3 * region).round(2).ravel().tolist()
    return view


def region_outline(point: np.ndarray, normal: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Outline of the 90 % region of a contact point in its tangent plane, base frame, shape (32, 3) [m]."""
    a = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.6 else [0.0, 1.0, 0.0])
    a /= np.linalg.norm(a)
    tangents = np.column_stack((a, np.cross(normal, a)))
    values, vectors = np.linalg.eigh(tangents.T @ covariance @ tangents)
    angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    circle = np.column_stack((np.cos(angle), np.sin(angle)))
    radii = np.sqrt(REGION_90 * np.clip(values, 0.0, None))
    return np.asarray(point + (circle * radii) @ vectors.T @ tangents.T)
