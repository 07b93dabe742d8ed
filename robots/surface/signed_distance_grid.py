"""Signed-distance grids of the links' skin: corrections of some tenths of a millimetre to the primitives.

The grids are built once from the meshes on the user's machine, stored in a file and memory-mapped; about one
second and one megabyte per link. `contactsense.robots.decomposition.grid_builder` builds them and is not
needed to use them.
"""

from pathlib import Path
from typing import NamedTuple, TypeAlias
from zipfile import BadZipFile

import numpy as np

from contactsense.robots.errors import RobotError
from contactsense.robots.files.whole_file import whole_file
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add_scaled, divide, dot, norm

BAND = 0.02
"""Distances are clipped to this range on both sides [m]; the skin is searched from points near it."""

_FORMAT = 1


class Grids(NamedTuple):
    """Grids of all links of a robot, in one array of values."""

    values: np.ndarray
    """Signed distance at the nodes, negative inside, x slowest, link after link, float32 [m]."""
    start: np.ndarray
    """Index of the first node of each link, and the total at the end, shape (links + 1,), int64; a link may
    have no nodes."""
    shape: np.ndarray
    """Nodes of each link along x, y, z, shape (links, 3), int64."""
    low: np.ndarray
    """First node of each link, link frame, shape (links, 3) [m]."""
    cell: float
    """Spacing of the nodes [m]."""


Skin: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]
"""The fields of `Grids` as a plain tuple: Numba takes longer to recognize a named one as an argument."""


@kernel
def sample(grids: Grids, link: int, point: Vector) -> tuple[float, Vector]:
    """Signed distance to the skin of a link and its gradient, trilinear between nodes.

    Args:
        grids: Those of the robot.
        link: Number of the link.
        point: Point, link frame [m].

    Returns:
        Distance (inf outside of the grid) [m], and its gradient.
    """
    low, cell, shape = grids.low[link], grids.cell, grids.shape[link]
    fx, fy, fz = (point[0] - low[0]) / cell, (point[1] - low[1]) / cell, (point[2] - low[2]) / cell
    nx, ny, nz = shape[0], shape[1], shape[2]
    if not (0.0 <= fx < nx - 1 and 0.0 <= fy < ny - 1 and 0.0 <= fz < nz - 1):
        return np.inf, (0.0, 0.0, 0.0)
    i, j, k = int(fx), int(fy), int(fz)
    u, v, w = fx - i, fy - j, fz - k
    values, at = grids.values, grids.start[link] + (i * ny + j) * nz + k
    row, plane = nz, ny * nz
    a, b = float(values[at]), float(values[at + 1])
    c, d = float(values[at + row]), float(values[at + row + 1])
    e, f = float(values[at + plane]), float(values[at + plane + 1])
    g, h = float(values[at + plane + row]), float(values[at + plane + row + 1])
    ab, cd, ef, gh = a + w * (b - a), c + w * (d - c), e + w * (f - e), g + w * (h - g)
    near, far = ab + v * (cd - ab), ef + v * (gh - ef)
    across = (1.0 - u) * (cd - ab) + u * (gh - ef)
    up = (1.0 - u) * ((1.0 - v) * (b - a) + v * (d - c)) + u * ((1.0 - v) * (f - e) + v * (h - g))
    return near + u * (far - near), ((far - near) / cell, across / cell, up / cell)


@kernel
def project_to_skin(grids: Grids, link: int, point: Vector, steps: int) -> tuple[float, Vector, Vector]:
    """Move a point near the skin onto it.

    Args:
        grids: Those of the robot.
        link: Index of the link.
        point: Point, link frame [m].
        steps: Newton steps along the gradient; three are enough from a few millimetres.

    Returns:
        Remaining distance (inf without skin nearby) [m], the point [m], and the outward unit normal there,
        link frame.
    """
    d, gradient = sample(grids, link, point)
    for _ in range(steps):
        square = dot(gradient, gradient)
        # The gradient vanishes where distances are clipped and at a medial surface.
        if not (abs(d) < 0.9 * BAND and square > 0.1):
            return np.inf, point, (0.0, 0.0, 0.0)
        point = add_scaled(point, -d / square, gradient)
        d, gradient = sample(grids, link, point)
    return _on_skin(d, gradient, point, 0.9 * BAND)


@kernel
def intersect_skin(
    grids: Grids, link: int, point: Vector, direction: Vector, steps: int
) -> tuple[float, Vector, Vector]:
    """Move a point near the skin onto it along a given line, such as the line of action of a contact force.

    A contact found on a primitive slightly off the skin is moved to where its line of action meets the skin:
    the moment c x f is the same at every point of that line.

    Args:
        grids: Those of the robot.
        link: Index of the link.
        point: Point, link frame [m].
        direction: Direction of the line, either sign, any length but zero, link frame.
        steps: Newton steps along the line; four are enough from a few millimetres.

    Returns:
        As `project_to_skin`; nothing is found where the line is nearly tangent to the skin.
    """
    along = divide(direction, norm(direction))
    d, gradient = sample(grids, link, point)
    for _ in range(steps):
        slope = dot(gradient, along)
        if not (abs(d) < 0.9 * BAND and abs(slope) > 0.2):
            return np.inf, point, (0.0, 0.0, 0.0)
        point = add_scaled(point, min(max(-d / slope, -0.5 * BAND), 0.5 * BAND), along)
        d, gradient = sample(grids, link, point)
    return _on_skin(d, gradient, point, 0.1 * BAND)


@kernel
def _on_skin(d: float, gradient: Vector, point: Vector, limit: float) -> tuple[float, Vector, Vector]:
    """What is returned of a point that has been moved onto the skin, if it is nearer to it than `limit`."""
    length = norm(gradient)
    if not (length > 0.3 and abs(d) < limit):
        return np.inf, point, (0.0, 0.0, 0.0)
    return d, point, divide(gradient, length)


def write(grids: Grids, path: Path) -> None:
    """Write grids as two files: `path` with the nodes, and the same with `.head.npz`.

    Raises:
        OSError: the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # The nodes last: where they are, the rest is there too. Two processes that need a new skin at the same
    # time write the same files.
    with whole_file(path.with_suffix(".head.npz")) as unfinished, unfinished.open("wb") as file:
        np.savez(file, format=_FORMAT, start=grids.start, shape=grids.shape, low=grids.low, cell=grids.cell)
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        np.save(file, grids.values.astype(np.float32))


def read(path: Path) -> Grids:
    """Read grids written by `write`; the nodes are memory-mapped.

    Raises:
        RobotError: the files are missing, damaged, or of another version.
    """
    try:
        with path.with_suffix(".head.npz").open("rb") as file, np.load(file) as head:
            version, start, shape, low = (head[name] for name in ("format", "start", "shape", "low"))
            cell = float(head["cell"])
        values = np.load(path, mmap_mode="r")
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise RobotError(f"{path}: no readable grid: {error}; delete it to rebuild it") from error
    if version != _FORMAT:
        raise RobotError(f"{path}: written by another version; delete it to rebuild it")
    if values.shape != (start[-1],):
        raise RobotError(
            f"{path}: damaged: {len(values)} nodes, expected {start[-1]}; delete it to rebuild it"
        )
    return Grids(values, start, shape, low, cell)
