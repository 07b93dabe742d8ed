"""A picture of the arm in its place: gravity, frames of base and sensors, links that can be touched, bodies
of the cell."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from contactsense.scene import Scene, WrenchSensor
from contactsense.service.drawing.figure_style import figure_style
from contactsense.service.drawing.link_geometry import body_meshes, link_meshes
from contactsense.service.drawing.palette import AXES, UNTOUCHED, link_colour
from contactsense.service.scene.summary import link_places

_VIEWS = ((-60.0, 18.0), (30.0, 18.0))
"""Azimuth and elevation of the two views [deg]."""
_LABEL_STEP = 0.07
"""Height of a name and the space above it, as a share of the view's height."""
_BODY_COLOURS = {"obstacle": "#b08968", "cover": "#8d99ae", "pedestal": "#6d597a"}
"""Role of a body -> its colour."""


def draw_scene(scene: Scene, q: np.ndarray, path: Path) -> None:
    """Write a PNG of the arm seen from two sides, the vertical of the world being that of the picture.

    Args:
        scene: The scene.
        q: Joint positions, shape (n,) [rad].
        path: Of the PNG.

    Raises:
        OSError: the file cannot be written.
    """
    mpl.use("Agg")
    with figure_style():
        _draw(scene, q, path)


def _draw(scene: Scene, q: np.ndarray, path: Path) -> None:
    from matplotlib import pyplot
    from matplotlib.patches import Patch

    to_world = scene.orientation.as_matrix()
    places = link_places(scene, q)
    triangles, colours = _triangles(scene, to_world, places)
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    figure, axes = pyplot.subplots(1, 2, figsize=(15.0, 7.5), layout="constrained")
    for plot, (azimuth, elevation) in zip(axes, _VIEWS, strict=True):
        camera = _camera(azimuth, elevation)
        _draw_surface(plot, camera, triangles, colours)
        _draw_gravity(plot, camera, triangles, size)
        for name, rotation, origin in _frames(scene, places):
            _draw_frame(plot, camera, name, to_world @ rotation, to_world @ origin, 0.12 * size)
            _draw_label(plot, name, (camera @ to_world @ origin)[:2])
        plot.autoscale_view()
        plot.set_aspect("equal", adjustable="datalim")
        plot.set_axis_off()
    touchable = scene.touchable_links
    legend = [Patch(color=_colour(scene, i), label=name) for i, name in enumerate(scene.link_names)]
    for patch in legend:
        if patch.get_label() not in touchable:
            patch.set_label(f"{patch.get_label()} (not touchable)")
    legend += [Patch(color=_BODY_COLOURS[b.role], label=f"{b.name} ({b.role})") for b in scene.bodies]
    figure.legend(handles=legend, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(f"{scene.robot.name} in its mounting, seen from two sides")
    figure.draw_without_rendering()  # which gives the views their size
    for plot in axes:
        _spread_labels(plot)
    try:
        figure.savefig(path, format="png")
    finally:
        pyplot.close(figure)


def _colour(scene: Scene, link: int) -> str:
    return link_colour(link) if scene.link_names[link] in scene.touchable_links else UNTOUCHED


def _triangles(scene: Scene, to_world: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all links and bodies, world axes, shape (T, 3, 3) [m], and their colours (T, 3), 0 to
    1."""
    links = zip(link_meshes(scene), places, strict=True)
    parts = [(mesh, place, _colour(scene, i)) for i, (mesh, place) in enumerate(links)]
    parts += [
        (mesh, np.eye(4), _BODY_COLOURS[body.role])
        for mesh, body in zip(body_meshes(scene), scene.bodies, strict=True)
    ]
    corners, colours = [], []
    for mesh, place, colour in parts:
        points = (mesh.vertices @ place[:3, :3].T + place[:3, 3]) @ to_world.T
        corners.append(points[mesh.faces])
        colours.append(np.tile(mpl.colors.to_rgb(colour), (len(mesh.faces), 1)))
    return np.concatenate(corners), np.concatenate(colours)


def _camera(azimuth: float, elevation: float) -> np.ndarray:
    """Rows: right, up and toward the viewer, world axes, shape (3, 3)."""
    a, e = np.radians(azimuth), np.radians(elevation)
    toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(toward, right), toward])


def _draw_surface(
    plot: "mpl.axes.Axes", camera: np.ndarray, triangles: np.ndarray, colours: np.ndarray
) -> None:
    """Draw triangles from the back to the front, those that face away left out."""
    from matplotlib.collections import PolyCollection

    seen = triangles @ camera.T
    normals = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    light = np.array([-0.4, 0.6, 1.0]) / np.linalg.norm([-0.4, 0.6, 1.0])
    order = np.argsort(seen[:, :, 2].mean(axis=1))
    order = order[normals[order, 2] > 0.0]
    shade = 0.4 + 0.6 * np.clip(normals[order] @ light, 0.0, 1.0)
    faces = colours[order] * shade[:, None]
    plot.add_collection(
        PolyCollection(seen[order, :, :2], facecolors=faces, edgecolors=faces, linewidths=0.3)
    )
    plot.autoscale_view()


def _draw_gravity(plot: "mpl.axes.Axes", camera: np.ndarray, triangles: np.ndarray, size: float) -> None:
    """Draw gravity as an arrow left of the arm."""
    seen = triangles.reshape(-1, 3) @ camera.T
    tail = np.array([seen[:, 0].min() - 0.12 * size, seen[:, 1].max()])
    tip = tail + 0.25 * size * (camera @ np.array([0.0, 0.0, -1.0]))[:2]
    plot.annotate(
        "", tuple(tip), tuple(tail), arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 2.5}
    )
    plot.text(tail[0], tail[1], "gravity", ha="center", va="bottom")
    plot.update_datalim([tail - 0.1 * size, tip])
    plot.autoscale_view()


def _frames(scene: Scene, places: np.ndarray) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Name, orientation (3, 3) and origin (3,) [m] of the frames that are drawn, base frame."""
    found = [("base", np.eye(3), np.zeros(3))]
    if scene.base_wrench is not None:
        sensor = scene.base_wrench
        found.append(("base sensor", sensor.rotation, np.array(sensor.translation)))
    for sensor in scene.link_wrenches:
        link = places[scene.robot.link_names.index(sensor.link)]
        found.append((f"{sensor.name} sensor", *_placed(sensor, link)))
    if scene.wrist_wrench is not None:
        found.append(("wrist sensor", *_placed(scene.wrist_wrench, places[-1])))
    return found


def _placed(sensor: WrenchSensor, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orientation and origin of a sensor that is given in the frame with this pose, shape (4, 4)."""
    R, o = sensor.rotation, np.array(sensor.translation)
    return place[:3, :3] @ R, place[:3, :3] @ o + place[:3, 3]


def _draw_frame(
    plot: "mpl.axes.Axes",
    camera: np.ndarray,
    name: str,
    rotation: np.ndarray,
    origin: np.ndarray,
    length: float,
) -> None:
    """Draw the axes of a frame, over the arm."""
    from matplotlib.patheffects import withStroke

    start = (camera @ origin)[:2]
    # The base frame and a sensor just below it stay distinguishable: the sensor's axes are longer and thin.
    sensor = name != "base"
    for i, colour in enumerate(AXES):
        end = start + (1.6 if sensor else 1.0) * length * (camera @ rotation[:, i])[:2]
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4 if sensor else 3.0}
        plot.annotate("", end, start, arrowprops=style | ({"linestyle": "--"} if sensor else {}))
        # Beside the tip, where no axis of the other frame is.
        x, y = end + 0.17 * length * _square_to(end - start)
        letter = plot.text(x, y, "xyz"[i], color=colour, ha="center", va="center", fontweight="bold")
        letter.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
        plot.update_datalim([end])


def _draw_label(plot: "mpl.axes.Axes", name: str, start: np.ndarray) -> None:
    """Name a frame whose origin is at `start` (2,) in the column of names, right of the view."""
    plot.annotate(
        f"{name} frame ({'solid' if name == 'base' else 'dashed'})",
        tuple(start),
        (1.0, 0.5),
        textcoords="axes fraction",
        va="center",
        arrowprops={"arrowstyle": "-", "color": "#555555", "linewidth": 0.8, "relpos": (0.0, 0.5)},
        bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "#999999"},
    )


def _spread_labels(plot: "mpl.axes.Axes") -> None:
    """Put the names of frames one above the other, in the order of the frames so that their lines do not
    cross, each as near to the height of its frame as the others allow."""
    from matplotlib.text import Annotation

    labels = [text for text in plot.texts if isinstance(text, Annotation) and text.get_text()]
    to_fraction = plot.transData + plot.transAxes.inverted()
    heights = [float(to_fraction.transform(label.xy)[1]) for label in labels]
    step = min(_LABEL_STEP, 1.0 / len(labels))
    above = 1.0
    for rank, i in enumerate(np.argsort(heights)[::-1]):
        lowest = (len(labels) - rank - 0.5) * step
        above = min(above - step, max(heights[i], lowest))
        labels[i].set_y(above)


def _square_to(step: np.ndarray) -> np.ndarray:
    """Unit vector at a right angle to a step (2,) in the picture; upward for none."""
    size = float(np.hypot(*step))
    return np.array([0.0, 1.0]) if size < 1e-9 else np.array([-step[1], step[0]]) / size
