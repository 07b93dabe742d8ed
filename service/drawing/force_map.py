"""Picture of an arm coloured by the smallest force that its sensors detect on each place."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.robots.surface.rendering import View, at_pose, side_by_side
from contactsense.scene import Scene
from contactsense.scene_model.constants import build_constants
from contactsense.service.drawing.figure_style import figure_style
from contactsense.service.drawing.palette import HEAT, heat_colours, heat_scale
from contactsense.surface_map.detectability import Detectability
from contactsense.surface_map.sensor_response import sensor_response
from contactsense.surface_map.smallest_force import detected_size, smallest_force

VIEWS = (-60.0, 120.0)
"""Directions from which the arm is seen, front and back, about the world's z axis [degrees]."""
ELEVATION = 18.0
WIDTH = 6.5
"""Width of the two views together [inches]."""
MARGIN = 12
"""White pixels around the arm."""
PIXELS = 560
"""Longer side of each view."""


def draw_force_map(
    cases: Sequence[tuple[str, Scene, Detectability]], q: np.ndarray, path: str | Path
) -> None:
    """Write a PNG: one row per case, the arm seen from two sides in its mounting, one scale of colours.

    Args:
        cases: Title, scene and map of each case, all in the same posture.
        q: Joint positions, shape (n,) [rad].
        path: Of the PNG.
    """
    mpl.use("Agg")
    with figure_style():
        _draw(cases, q, path)


def _draw(cases: Sequence[tuple[str, Scene, Detectability]], q: np.ndarray, path: str | Path) -> None:
    from matplotlib import pyplot as plt
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    forces = np.concatenate([found.smallest_force for _, _, found in cases])
    low, high = heat_scale(forces)
    scale = mpl.cm.ScalarMappable(LogNorm(low, high), LinearSegmentedColormap.from_list("heat", HEAT))
    pictures = [_views(scene, found, q, (low, high)) for _, scene, found in cases]
    height = sum(WIDTH * picture.shape[0] / picture.shape[1] + 0.6 for picture in pictures)
    figure, axes = plt.subplots(
        len(cases), 1, figsize=(WIDTH + 1.5, height + 0.4), squeeze=False, layout="constrained"
    )
    for axis, (title, _, _), picture in zip(axes[:, 0], cases, pictures, strict=True):
        axis.imshow(picture)
        axis.set_title(title)
        axis.axis("off")
    if np.isfinite(forces).any():
        bar = figure.colorbar(scale, ax=axes[:, 0].tolist(), shrink=0.7)
        detection = cases[0][2].detection
        bar.set_label(f"smallest force / N, detected with probability {detection:g}")
        bar.ax.yaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_formatter(mpl.ticker.NullFormatter())
        if (forces > high).any():
            figure.supxlabel(f"light grey: more than {high:.3g} N")
    else:
        figure.supxlabel("light grey: no push is sure to be detected")
    try:
        figure.savefig(path, format="png")
    finally:
        plt.close(figure)


def _views(scene: Scene, found: Detectability, q: np.ndarray, scale: tuple[float, float]) -> np.ndarray:
    """The arm from two sides, image (rows, columns, 3); `scale`: forces at the ends of the colour scale
    [N]."""
    constants, motion = build_constants(scene), empty_motion(len(q))
    forward_kinematics(constants.model, q, motion)
    response, size = sensor_response(scene, constants, motion), detected_size(scene, found.detection)
    world = scene.orientation.as_matrix()
    poses = np.tile(np.eye(4), (len(scene.link_names), 1, 1))
    depth = constants.sensors.depth
    poses[:, :3, :3], poses[:, :3, 3] = world @ motion.rotation[depth], motion.origin[depth] @ world.T
    # Bodies that cover the arm follow the last link's primitives.
    of_links = {
        name: array[: constants.surfaces.start[-1]]
        for name, array in constants.surfaces._asdict().items()
        if name != "start"
    }
    surfaces = at_pose(constants.surfaces._replace(**of_links), poses)
    reach = surfaces.radius[:, None]
    low, top = (surfaces.origin - reach).min(axis=0), (surfaces.origin + reach).max(axis=0)
    images = []
    for azimuth in VIEWS:
        view = View(low, top, azimuth, ELEVATION, PIXELS)
        which, points, normals = view.trace(surfaces)
        hit = which >= 0
        link = surfaces.link[which[hit]]
        force = np.empty(len(link))
        for index in np.unique(link):
            on = link == index
            force[on] = smallest_force(
                np.broadcast_to(response[index], (on.sum(), *response[index].shape)),
                size,
                points[hit][on] @ world,
                normals[hit][on] @ world,
            )
        colours = np.zeros((*which.shape, 3))
        colours[hit] = heat_colours(force, *scale)
        rows, columns = np.flatnonzero(hit.any(axis=1)), np.flatnonzero(hit.any(axis=0))
        part = view.shaded(normals, colours, hit)[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        images.append(np.pad(part, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), constant_values=255))
    return side_by_side(images)
