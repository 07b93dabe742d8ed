"""The arm in 3D as plain data for `arm_view.js`, which draws it in a browser without any library.

A copy of a 3D library would add 0.8 MB to every report; the arm's geometry is a fifth of that.
"""

from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contactsense.scene import Scene
from contactsense.service.drawing.contact_shapes import arrow_ends, region_patch
from contactsense.service.drawing.link_geometry import Mesh, link_meshes
from contactsense.service.drawing.palette import CONTACT, link_colour


def view_script() -> str:
    """The JavaScript code for drawing: `drawArm(canvas, geometry, view)`."""
    return (Path(__file__).parent / "arm_view.js").read_text(encoding="utf-8")


def arm_geometry(scene: Scene) -> list[dict[str, Any]]:
    """Meshes of all links, pedestals with the base link's, each with its `color`, see `packed`."""
    meshes = link_meshes(scene, pedestals=True)
    return [{"color": link_colour(i), **packed(mesh)} for i, mesh in enumerate(meshes)]


def packed(mesh: Mesh) -> dict[str, str]:
    """A mesh of at most 65536 vertices as base64 of little-endian integers.

    Returns:
        `vertices`: 16 bit, in tenths of a millimetre, so that what is more than 3.2 m away is drawn nearer;
        `faces`: indices, 16 bit, without sign.
    """
    near = np.clip(1e4 * mesh.vertices, -32_000.0, 32_000.0)
    numbers = np.rint(near).astype("<i2"), mesh.faces.astype("<u2")
    vertices, faces = (b64encode(each.tobytes()).decode("ascii") for each in numbers)
    return {"vertices": vertices, "faces": faces}


def arm_view(poses: Sequence[tuple[np.ndarray, np.ndarray]], up: np.ndarray) -> dict[str, Any]:
    """View of one posture.

    Args:
        poses: Origin (3,) [m] and rotation (3, 3) of each link in the base frame.
        up: Upward direction in the picture, base axes, shape (3,).
    """
    return {
        "poses": [[*(1e3 * o).round(2), *r.ravel().round(5)] for o, r in poses],
        "up": up.round(5).tolist(),
    }


def contact_view(
    scene: Scene,
    poses: Sequence[tuple[np.ndarray, np.ndarray]],
    link: int,
    point: np.ndarray,
    normal: np.ndarray,
    covariance: np.ndarray,
    force: np.ndarray,
) -> dict[str, Any]:
    """What a contact adds to the view of its posture: nothing where its place is not known.

    Args:
        scene: The scene.
        poses: As for `arm_view`.
        link: Index of the touched link.
        point: Contact point, base frame, shape (3,) [m].
        normal: Outward unit normal of the link there, base axes, shape (3,).
        covariance: Covariance of the point, base axes, shape (3, 3) [m^2].
        force: Force on the robot, base axes, shape (3,) [N].
    """
    if link < 0 or not np.isfinite(point).all():
        return {}
    origin, turn = poses[link]
    tail, head = arrow_ends(point, force)
    patch = region_patch(scene, link, (point - origin) @ turn, normal @ turn, turn.T @ covariance @ turn)
    return {
        "point": (1e3 * head).round(2).tolist(),
        "normal": normal.round(4).tolist(),
        "arrow": (1e3 * tail).round(2).tolist(),
        "region": {"link": link, **packed(patch)},
        "color": CONTACT,
    }
