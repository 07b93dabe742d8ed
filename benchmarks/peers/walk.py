"""A random step on the surface of the arm: the motion model of the particle filters.

A particle is a place in its link's frame with the normal there. It is displaced at random and projected back
to the nearest point of the arm, which may lie on the link before or after its own.
"""

import numpy as np

from contactsense.benchmarks.peers.stage import Stage, to_base, to_link
from contactsense.robots.jit.kernel import allocating_kernel, kernel
from contactsense.robots.surface.union import nearest

_MAX_DEPTH = 1e-4
"""Points deeper inside a neighbouring link are rejected [m]."""


@kernel
def _nearest_on_link(
    stage: Stage, link: int, x: float, y: float, z: float, within: float
) -> tuple[float, float, float, float, float, float, float]:
    """Distance of a point of the base frame to one link if below `within`, else infinity, and the nearest
    place and normal in its frame."""
    px, py, pz = to_link(stage.motion, link, x, y, z)
    surfaces, ball = stage.surfaces, stage.ball[link]
    reach = within + ball[3]
    if reach <= 0.0 or (px - ball[0]) ** 2 + (py - ball[1]) ** 2 + (pz - ball[2]) ** 2 >= reach * reach:
        return np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    d, _, (sx, sy, sz), (nx, ny, nz) = nearest(
        surfaces, surfaces.start[link], surfaces.start[link + 1], (px, py, pz)
    )
    return d, sx, sy, sz, nx, ny, nz


@allocating_kernel
def walk(
    rng: np.random.Generator,
    stage: Stage,
    step: float,
    link: int,
    point: np.ndarray,
    normal: np.ndarray,
    new_point: np.ndarray,
    new_normal: np.ndarray,
) -> int:
    """Move a particle at random; it does not move if the step ends at a place that cannot be touched.

    Args:
        rng: A NumPy generator.
        stage: Poses of the links, and their surfaces.
        step: Standard deviation of the step [m].
        link, point, normal: Its position: index of the link, place (3,) [m] and normal (3,), link frame.
        new_point, new_normal: Filled, shapes (3,).

    Returns:
        Index of its new link.
    """
    x, y, z = to_base(
        stage.motion,
        link,
        point[0] + step * rng.standard_normal(),
        point[1] + step * rng.standard_normal(),
        point[2] + step * rng.standard_normal(),
    )
    first, last = max(0, link - 1), min(len(stage.ball), link + 2)
    best, found = np.inf, link
    for other in range(first, last):
        d, sx, sy, sz, nx, ny, nz = _nearest_on_link(stage, other, x, y, z, best)
        if d < best:
            best, found = d, other
            new_point[0], new_point[1], new_point[2] = sx, sy, sz
            new_normal[0], new_normal[1], new_normal[2] = nx, ny, nz
    # From outside, the nearest point is on the surface of the union; from inside, it may lie in another body.
    if best < 0.0:
        x, y, z = to_base(stage.motion, found, new_point[0], new_point[1], new_point[2])
        for other in range(first, last):
            d, _, _, _, _, _, _ = _nearest_on_link(stage, other, x, y, z, 0.0)
            if d < -_MAX_DEPTH:
                best = np.inf
    if best == np.inf:
        new_point[:] = point
        new_normal[:] = normal
        return link
    return found
