"""Places that cannot be touched: inside another body of the arm, or under the base."""

import math

from contactsense.energy import TAIL
from robots.compiled import fused_kernel
from robots.surface import project


@fused_kernel
def log_exposed(surfaces, found, own, x, y, z, prior):  # type: ignore[no-untyped-def]
    """Log of how far a place can be touched: 0, or less where there is no room above it, because it lies inside
    another primitive of its link or of a neighbour, or faces one nearby.

    As the surfaces may be off, a little too little room still counts.

    Args:
        surfaces, found: Primitives, and where they are.
        own: Primitive to which the place belongs.
        x, y, z: A point above the place by the room that is needed, base frame [m].
        prior: What is known of contacts beforehand.
    """
    link = surfaces.link[own]
    first = surfaces.start[max(link - 1, 0)]
    last = surfaces.start[min(link + 2, surfaces.start.shape[0] - 1)]
    deepest = 0.0
    for p in range(first, last):
        o = found.origin[p]
        dx, dy, dz = x - o[0], y - o[1], z - o[2]
        if p == own or dx * dx + dy * dy + dz * dz > surfaces.radius[p] ** 2:
            continue
        R = found.rotation[p]
        d = project(
            surfaces.kind[p],
            surfaces.size[p],
            R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
            R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
            R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
        )[0]
        deepest = min(deepest, d)
    return -0.5 * (TAIL + 1.0) * math.log(1.0 + (deepest / prior.offset) ** 2 / TAIL)


@fused_kernel
def stands_on(link, z, nz, spread):  # type: ignore[no-untyped-def]
    """Whether a place is on the face on which the base stands; what stands on the mounting plane, z = 0 of
    the base frame, cannot be touched from below."""
    return link == 0 and z < spread and nz < -0.5
