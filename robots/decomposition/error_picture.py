"""Pictures of a fit: for each link its mesh, its primitives, and the error on both."""

from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
import trimesh
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from contactsense.robots.decomposition.distance_samples import Shape
from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
from contactsense.robots.decomposition.outer_skin import outer_skin
from contactsense.robots.decomposition.surface_error import packed
from contactsense.robots.robot import Robot
from contactsense.robots.surface.rendering import COLOURS, View, caption, save, side_by_side
from contactsense.robots.surface.union import distances

SPAN = 0.005
"""Error at the ends of the colour scale [m]: blue where primitives protrude from the skin, red where they are
below it."""


def draw_fits(
    robot: Robot,
    meshes: Mapping[str, trimesh.Trimesh],
    bodies: Mapping[str, Bodies],
    path: str | Path,
    pixels: int = 360,
    drawn: Callable[[], None] = lambda: None,
) -> None:
    """Write a PNG: a row for each link with its name, mesh, primitives, error on the mesh and error on the
    primitives.

    Args:
        robot: The arm.
        meshes: Visual surface of each link, in its frame [m].
        bodies: Primitives of each link.
        path: Path of the PNG.
        pixels: Width and height of each picture.
        drawn: Called after each link.
    """
    rows = []
    for name, own in bodies.items():
        number = robot.link_names.index(name)
        skin = outer_skin(meshes[name], neighbour_poses(robot, meshes, number))
        rows.append(side_by_side(_link(meshes[name], own, Shape(skin), pixels)))
        drawn()
    width = max(row.shape[1] for row in rows)
    padded = []
    for name, row in zip(bodies, rows, strict=True):
        padded.append(caption(f"{name}: mesh, primitives, error on the mesh, error on the primitives", width))
        padded.append(np.pad(row, ((4, 4), (0, width - row.shape[1]), (0, 0)), constant_values=255))
    save(np.concatenate(padded), path)


def _link(mesh: trimesh.Trimesh, bodies: Bodies, shape: Shape, pixels: int) -> list[np.ndarray]:
    view = View(mesh.bounds[0], mesh.bounds[1], -50.0, 25.0, pixels)
    surfaces = packed(bodies)
    palette = np.array(COLOURS, dtype=np.float64)
    which, points, normals = view.trace(surfaces)
    drawn = view.shaded(normals, palette[which % len(palette)], which >= 0)
    off = np.zeros(which.shape)
    off[which >= 0] = -shape.distance(points[which >= 0])
    coloured = view.shaded(normals, _scale(off), which >= 0)
    hit, places, facing = _cast(mesh, view)
    grey = np.full((*view.shape, 3), 190.0)
    short = np.zeros(view.shape)
    short[hit] = distances(surfaces, places[hit])[0]
    return [view.shaded(facing, grey, hit), drawn, view.shaded(facing, _scale(short), hit), coloured]


def _scale(error: np.ndarray) -> np.ndarray:
    """Colours of errors: blue below zero, red above, shape (..., 3)."""
    return np.asarray(mpl.colormaps["coolwarm"](0.5 + 0.5 * error / SPAN)[..., :3] * 255.0)


def _cast(mesh: trimesh.Trimesh, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the rays of a view meet a mesh: hit or not (rows, columns), points and facing normals (rows,
    columns, 3)."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, np.asarray(mesh.triangles, dtype=np.float32))
    starts = view.origins.reshape(-1, 3)
    ahead = np.broadcast_to(view.direction, starts.shape)
    found = scene.run(starts.astype(np.float32), np.ascontiguousarray(ahead, dtype=np.float32), output=True)
    hit = np.asarray(found["primID"]) >= 0
    far = np.where(hit, found["tfar"], 0.0)
    normals = np.asarray(mesh.face_normals)[np.where(hit, found["primID"], 0)]
    normals = normals * np.where(normals @ view.direction > 0.0, -1.0, 1.0)[:, None]
    points = starts + far[:, None] * view.direction
    return hit.reshape(view.shape), points.reshape(*view.shape, 3), normals.reshape(*view.shape, 3)
