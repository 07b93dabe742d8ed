"""Pictures of primitives, by walking along rays from an orthographic camera to the surface of their union."""

from collections.abc import Sequence
from math import sqrt
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.link_poses import link_poses
from contactsense.robots.robot import Robot
from contactsense.robots.surface.convex_primitives import Surfaces, pack
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import add_scaled, dot, subtract, vector

_CLOSE = 1e-4
"""A ray has arrived when it is so near to a surface [m]."""

COLOURS = (
    (131, 134, 127),
    (72, 154, 226),
    (225, 122, 0),
    (85, 234, 175),
    (141, 67, 136),
    (183, 212, 239),
    (180, 31, 0),
    (222, 211, 113),
    (67, 76, 191),
)
"""Of links, in turn, as red, green, blue: distinguishable for the colour-blind."""


class View:
    """An orthographic camera: rays through the pixels of an image, and light from its upper left."""

    def __init__(
        self, low: np.ndarray, high: np.ndarray, azimuth: float, elevation: float, pixels: int = 700
    ) -> None:
        """Look at the box from `low` to `high` (3,) [m], from a direction given in degrees."""
        a, e = np.radians(azimuth), np.radians(elevation)
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        up = np.cross(toward, right)
        corners = np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )
        middle = (low + high) / 2.0
        width, height = 1.08 * np.ptp(corners @ right), 1.08 * np.ptp(corners @ up)
        self.depth = float(np.linalg.norm(high - low))
        scale = max(width, height) / pixels
        self.shape = (max(int(height / scale), 1), max(int(width / scale), 1))
        rows = (np.arange(self.shape[0])[::-1] + 0.5 - self.shape[0] / 2.0) * scale
        columns = (np.arange(self.shape[1]) + 0.5 - self.shape[1] / 2.0) * scale
        self.direction = -toward
        start = middle + self.depth * toward
        self.origins = start + rows[:, None, None] * up + columns[None, :, None] * right
        light = toward + 0.6 * up - 0.4 * right
        self.light = light / np.linalg.norm(light)

    def shaded(self, normals: np.ndarray, colours: np.ndarray, hit: np.ndarray) -> np.ndarray:
        """Image (rows, columns, 3) of 8-bit colours, white where nothing is hit.

        Args:
            normals: Of what each pixel shows, shape (rows, columns, 3).
            colours: Its colour, shape (rows, columns, 3), 0 to 255.
            hit: Whether it shows anything, shape (rows, columns).
        """
        brightness = 0.35 + 0.65 * np.clip(normals @ self.light, 0.0, 1.0)
        image = np.where(hit[..., None], colours * brightness[..., None], 255.0)
        return np.asarray(np.clip(image, 0.0, 255.0), dtype=np.uint8)

    def trace(self, surfaces: Surfaces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What each pixel shows of primitives, all taken as one union in one frame.

        Returns:
            Number of the primitive (rows, columns), -1 for none; surface points and normals (rows, columns,
            3).
        """
        which = np.empty(self.shape, dtype=np.int64)
        points, normals = np.zeros((*self.shape, 3)), np.zeros((*self.shape, 3))
        _trace(
            surfaces,
            self.origins.reshape(-1, 3),
            self.direction,
            2.0 * self.depth,
            which.reshape(-1),
            points.reshape(-1, 3),
            normals.reshape(-1, 3),
        )
        return which, points, normals


@kernel
def _trace(
    surfaces: Surfaces,
    starts: np.ndarray,
    direction: np.ndarray,
    reach: float,
    which: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
) -> None:
    d = vector(direction)
    count = surfaces.kind.shape[0]
    for i in range(starts.shape[0]):
        which[i] = -1
        start = vector(starts[i])
        # Start where the ray enters the first ball around a primitive; most rays enter none.
        near = reach
        for p in range(count):
            offset = subtract(vector(surfaces.origin[p]), start)
            along = dot(offset, d)
            inside = surfaces.radius[p] * surfaces.radius[p] - (dot(offset, offset) - along * along)
            if inside > 0.0:
                near = min(near, along - sqrt(inside))
        travelled = max(near, 0.0)
        while travelled < reach:
            gap, k, place, normal = nearest(surfaces, 0, count, add_scaled(start, travelled, d))
            if gap < _CLOSE:
                which[i] = k
                points[i, 0], points[i, 1], points[i, 2] = place
                normals[i, 0], normals[i, 1], normals[i, 2] = normal
                break
            travelled += gap


def at_pose(surfaces: Surfaces, poses: np.ndarray) -> Surfaces:
    """Primitives of all links in one frame, for poses (links, 4, 4) of the links in it."""
    place = poses[surfaces.link]
    return surfaces._replace(
        rotation=np.ascontiguousarray(place[:, :3, :3] @ surfaces.rotation),
        origin=np.ascontiguousarray(
            np.einsum("pij,pj->pi", place[:, :3, :3], surfaces.origin) + place[:, :3, 3]
        ),
    )


def render_arm(robot: Robot, q: np.ndarray, coarse: bool = False, pixels: int = 700) -> np.ndarray:
    """An arm's primitives, coloured by link, seen from two sides.

    Args:
        robot: The arm.
        q: Joint angles, shape (n,) [rad].
        coarse: Whether to show the coarse level instead of the fine one.
        pixels: Longer side of each view.

    Returns:
        8-bit colours, shape (rows, columns, 3).

    Raises:
        ValueError: the robot has no primitives, or `q` is no pose of it.
    """
    surfaces = at_pose(pack(robot.links, coarse), link_poses(robot, q))
    if len(surfaces.kind) == 0:
        raise ValueError(f"{robot.name} has no primitives; `contactsense decompose` makes them from meshes")
    reach = surfaces.radius[:, None]
    low, high = (surfaces.origin - reach).min(axis=0), (surfaces.origin + reach).max(axis=0)
    palette = np.array(COLOURS, dtype=np.float64)
    images = []
    for azimuth in (-60.0, 30.0):
        view = View(low, high, azimuth, 18.0, pixels)
        which, _, normals = view.trace(surfaces)
        colours = palette[surfaces.link[which] % len(palette)]
        # Primitives of one link in two shades, so that their seams show.
        colours = colours * np.where(which[..., None] % 2 == 0, 1.0, 0.86)
        images.append(view.shaded(normals, colours, which >= 0))
    return side_by_side(images)


def side_by_side(images: Sequence[np.ndarray]) -> np.ndarray:
    """Images next to each other on white, shape (rows, columns, 3)."""
    rows = max(image.shape[0] for image in images)
    padded = []
    for image in images:
        missing = rows - image.shape[0]
        padded.append(
            np.pad(image, ((missing // 2, missing - missing // 2), (4, 4), (0, 0)), constant_values=255)
        )
    return np.concatenate(padded, axis=1)


def caption(text: str, width: int, height: int = 24) -> np.ndarray:
    """A line of text, black on white, shape (height, width, 3)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100.0)
    figure.text(8.0 / width, 0.5, text, va="center", fontsize=10)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:height, :width, :3]


def save(image: np.ndarray, path: str | Path) -> None:
    """Write an image (rows, columns, 3) of 8-bit colours as PNG."""
    mpl.use("Agg")
    from matplotlib import image as writer

    writer.imsave(path, image, format="png")
