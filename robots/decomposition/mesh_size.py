"""Links whose mesh is too large for the joints at their ends, as with a wrong scale of the mesh."""

from collections.abc import Mapping

import numpy as np
import trimesh

from contactsense.robots import Robot

_LONG = 0.5
"""A link is long if its joints are farther apart than this share of the longest distance between two joints:
on short links, the housing of a drive may be larger than the distance."""
_BEYOND = 0.8
"""Surfaces of long links of real arms extend beyond a joint by at most half the distance between the joints;
those of twice the right size by about the whole of it or more. Torsos of humanoids, which carry two arms and
a head, may extend as far."""


def too_large(robot: Robot, meshes: Mapping[str, trimesh.Trimesh]) -> dict[str, tuple[float, float]]:
    """Long links whose mesh extends far beyond one of their two joints, along the line through both.

    The base and the last link are not compared: there may be anything below the one and on the other.

    Args:
        robot: The arm.
        meshes: The mesh of each link, in the link's frame [m].

    Returns:
        Name of the link -> how far its mesh extends beyond a joint, and how far the joints are apart [m].
    """
    between = {
        link.name: joint.translation for link, joint in zip(robot.links[1:-1], robot.joints[1:], strict=True)
    }
    longest = max((float(np.linalg.norm(step)) for step in between.values()), default=0.0)
    found = {}
    for name, step in between.items():
        apart = float(np.linalg.norm(step))
        if name not in meshes or apart == 0.0 or apart < _LONG * longest:
            continue
        along = meshes[name].vertices @ step / apart
        beyond = float(max(along.max() - apart, -along.min()))
        if beyond > _BEYOND * apart:
            found[name] = (beyond, apart)
    return found
