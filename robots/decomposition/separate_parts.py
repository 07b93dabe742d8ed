"""Rigid bodies of several separate parts, such as a gripper with its fingers: fitted part by part.

A union that grows from one primitive begins with a body that also fills the air between the fingers, and each
further primitive improves that too little to go on.
"""

from collections.abc import Sequence
from functools import reduce

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from contactsense.robots.decomposition.decompose import Fit, Options, fit_body, measured_fit
from contactsense.robots.decomposition.least_squares_fit import Bodies
from contactsense.robots.decomposition.outer_skin import OutOfReachError, Surroundings, outer_skin

SMALL = 0.02
"""Parts of which no edge is longer, such as pins and screws, belong to the nearest larger one [m]."""
MOST = 40
"""Of a mesh with more parts than these the facets are not joined: it is fitted as a whole."""


def separate_parts(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """The parts of a mesh that share no vertex; the mesh itself if there is only one."""
    joined = mesh.copy()
    joined.merge_vertices()
    pieces = list(joined.split(only_watertight=False))
    large = [piece for piece in pieces if float(piece.extents.max()) > SMALL]
    if not 2 <= len(large) <= MOST:
        return [mesh]
    groups, trees = [[piece] for piece in large], [cKDTree(piece.vertices) for piece in large]
    for piece in pieces:
        if float(piece.extents.max()) <= SMALL:
            nearest = min(range(len(large)), key=lambda i: float(trees[i].query(piece.centroid)[0]))
            groups[nearest].append(piece)
    return [_together(group) for group in groups]


def _together(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate(meshes)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def fit_part(parts: Sequence[trimesh.Trimesh], number: int, options: Options) -> tuple[Fit, ...]:
    """Fits of one part, the others being obstacles for a finger on it; none if it cannot be touched.

    As `contactsense.robots.decomposition.decompose.fit_link`.
    """
    others = [part for i, part in enumerate(parts) if i != number]
    try:
        skin = outer_skin(parts[number], [others], options.samples, options.seed)
        return fit_body(skin, Surroundings(parts[number], [others]), np.eye(3), options)
    except OutOfReachError:
        return ()


def joined_fit(mesh: trimesh.Trimesh, parts: Sequence[Fit], options: Options) -> Fit:
    """The union of the primitives of all parts, compared with the whole mesh."""
    bodies = reduce(Bodies.joined, (part.bodies for part in parts))
    skin = outer_skin(mesh, count=options.samples, seed=options.seed)
    return measured_fit(bodies, skin, Surroundings(mesh), options)
