"""`contactsense bench geometry MESHES`: distance of each level of detail from the visual meshes."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import robots as library
from contactsense.benchmarks import options
from contactsense.benchmarks.accuracy.link_geometry import measure_links, print_links
from contactsense.robots import Link, Robot, RobotError
from contactsense.robots import yaml_schema as schema
from contactsense.robots.extras import install_command
from contactsense.robots.library import surface_file
from contactsense.robots.surface.signed_distance_grid import Grids, project_to_skin, sample
from contactsense.robots.vectors import vector

if TYPE_CHECKING:
    import trimesh

    from contactsense.robots.decomposition.outer_skin import Skin, Surroundings
    from contactsense.robots.decomposition.surface_error import Errors

LEVELS = ("coarse", "fine", "skin")
COLUMNS = ("p50", "p95", "max")
BYTES = 184
"""Of a primitive in the arrays of `contactsense.robots.surface.convex_primitives.Surfaces`."""


@click.command()
@click.argument("meshes", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--robot", "names", multiple=True, help="Arm; may be repeated. All in MESHES without it.")
@click.option("--links", is_flag=True, help="The fine level of each link, and why it is beyond 2 mm.")
@options.as_json
def geometry(meshes: Path, names: tuple[str, ...], links: bool, as_json: bool) -> None:
    """Compare every level of detail with the skin of the meshes in MESHES/<robot>/<link>.ply.

    Skin that is always covered by neighbours or the mounting is excluded, and so are the primitives there.
    """
    rows: list[dict[str, Any]] = []
    names = names or tuple(name for name in library.names() if (meshes / name).is_dir())
    if not names:
        raise click.ClickException(f"{meshes}: expected a folder named after an arm of the library, got none")
    measure = measure_links if links else _measure
    try:
        for name in track(names, console=Console(stderr=True), description="arms"):
            rows += measure(library.load(name), meshes / name)
    except ImportError as error:
        raise click.ClickException(
            f"bench geometry needs the extra packages: {install_command('geometry')} ({error})"
        ) from error
    except RobotError as error:
        raise click.ClickException(str(error)) from error
    if as_json:
        click.echo(json.dumps(rows, indent=1))
    elif links:
        print_links(rows)
    else:
        _print(rows)


def _measure(robot: Robot, folder: Path) -> list[dict[str, Any]]:
    """One row for each level of detail of one arm."""
    from contactsense.robots.decomposition.distance_samples import Shape
    from contactsense.robots.decomposition.grid_builder import cached
    from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
    from contactsense.robots.decomposition.outer_skin import Surroundings, outer_skin
    from contactsense.robots.decomposition.surface_error import (
        Errors,
        bodies_of,
        errors,
        together,
    )
    from contactsense.robots.urdf.meshes import from_folder

    meshes = from_folder(folder, robot.link_names)
    grids = cached(robot, meshes)
    found: dict[str, list[Errors]] = {"coarse": [], "fine": []}
    skin_level: list[Errors] = []
    for number, link in enumerate(robot.links):
        poses = neighbour_poses(robot, meshes, number, seed=1)
        skin = outer_skin(meshes[link.name], poses, seed=1)
        shape, around = Shape(skin), Surroundings(meshes[link.name], poses)
        for name, shapes in (("coarse", link.coarse), ("fine", link.primitives)):
            found[name].append(errors(bodies_of(shapes), skin, shape, around, seed=1))
        distance, angle = _grid_at_skin(grids, number, skin)
        back = _skin_at_grid(grids, number, link, meshes[link.name], around)
        skin_level.append(Errors(distance, back, angle, found["fine"][-1].area))
    seconds = schema.read_surface(surface_file(robot.name)).fit_seconds
    common = {"robot": robot.name, "fit_seconds": seconds}
    counts = {
        "coarse": sum(len(link.coarse) for link in robot.links),
        "fine": sum(len(link.primitives) for link in robot.links),
    }
    rows = [
        common
        | {"level": level, "primitives": counts[level], "bytes": counts[level] * BYTES}
        | _row(together(parts))
        for level, parts in found.items()
    ]
    size = counts["fine"] * BYTES + grids.values.nbytes
    rows.append(
        common | {"level": "skin", "primitives": counts["fine"], "bytes": size} | _row(together(skin_level))
    )
    return rows


def _grid_at_skin(grids: Grids, number: int, skin: "Skin") -> tuple[np.ndarray, np.ndarray]:
    """Signed distance [m] and angle to the normal [rad] that a link's grid has at the N exposed points of its
    skin, shapes (N,)."""
    exposed = skin.exposure > 0.0
    points, normals = skin.points[exposed], skin.normals[exposed]
    sampled = [sample(grids, number, vector(point)) for point in points]
    distance, slope = np.array([d for d, _ in sampled]), np.array([s for _, s in sampled])
    gradient = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    return distance, np.arccos(np.clip(np.einsum("ij,ij->i", gradient, normals), -1.0, 1.0))


def _skin_at_grid(
    grids: Grids, number: int, link: Link, mesh: "trimesh.Trimesh", around: "Surroundings"
) -> np.ndarray:
    """Distances from exposed points of the grid's surface to the mesh, shape (M,) [m]."""
    import trimesh

    from contactsense.robots.decomposition.surface_error import bodies_of, exposed_surface

    rng = np.random.default_rng(1)
    start = exposed_surface(bodies_of(link.primitives), 5000, rng)
    projected = [project_to_skin(grids, number, vector(point), 3) for point in start]
    level = np.array([(distance, *point, *normal) for distance, point, normal in projected])
    level = level[np.isfinite(level[:, 0])]
    level = level[around.exposure_of_model(level[:, 1:4], level[:, 4:], rng) > 0.0]
    return np.asarray(
        trimesh.proximity.closest_point(mesh, level[:, 1:4])[1]  # type: ignore[no-untyped-call]
    )


def _row(found: "Errors") -> dict[str, Any]:
    """Lengths and angles of one level; no lengths from the model where none of its surface is exposed."""

    def lengths(values: np.ndarray) -> dict[str, float] | None:
        if len(values) == 0:
            return None
        values = np.abs(values) * 1e3
        percentiles = np.percentile(values, (50.0, 95.0, 100.0))
        named = dict(zip(COLUMNS, (round(float(value), 3) for value in percentiles), strict=True))
        most = round(float(np.percentile(values, 90.0)), 3)
        return {"mean": round(float(values.mean()), 3), "p90": most} | named

    angle = np.degrees(np.percentile(found.angle, (50.0, 90.0, 95.0)))
    return {
        "skin_to_model_mm": lengths(found.skin),
        "model_to_skin_mm": lengths(found.primitive),
        "normal_deg": dict(zip(("p50", "p90", "p95"), np.round(angle, 2).tolist(), strict=True)),
    }


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(title="distances in mm: mean / p50 / p95 / max; normals in degrees: p50 / p95")
    for heading in (
        "arm",
        "level",
        "primitives",
        "skin to model",
        "model to skin",
        "normals",
        "fit [s]",
        "kB",
    ):
        table.add_column(heading, justify="left" if heading in ("arm", "level") else "right")
    for row in rows:
        lengths = [
            " / ".join(f"{row[key][part]:.2f}" for part in ("mean", *COLUMNS)) if row[key] else "not exposed"
            for key in ("skin_to_model_mm", "model_to_skin_mm")
        ]
        angles = f"{row['normal_deg']['p50']:.1f} / {row['normal_deg']['p95']:.1f}"
        seconds, size = f"{row['fit_seconds']:.0f}", f"{row['bytes'] / 1e3:.0f}"
        table.add_row(row["robot"], row["level"], str(row["primitives"]), *lengths, angles, seconds, size)
    Console(width=132).print(table)
