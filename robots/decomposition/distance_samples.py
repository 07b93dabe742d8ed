"""Samples of the signed distance that a union of primitives should have, from a link's skin."""

import numpy as np
from scipy.spatial import cKDTree

from contactsense.robots.decomposition.least_squares_fit import AT_LEAST, AT_MOST, EQUAL, Target
from contactsense.robots.decomposition.outer_skin import Skin, Surroundings

_HIDDEN = 0.05
"""Weight of skin that is always covered by neighbours, relative to 1 for skin that can be touched."""

_HIDDEN_AIR = 0.3
"""The same for the space above it: a primitive that protrudes there would cover the neighbour's skin."""

_ABOVE = 0.001
"""Height above the skin from which it is decided whether its neighbours shut it in [m]."""

_SHUT_IN = 0.1
"""Factor on the weight of space that the neighbours shut in, such as the recess that holds their hub: a
primitive may fill it, but need not."""

_INSIDE, _OUTSIDE = 0.47, 0.55
"""Fractions of free directions below which a point behind the skin counts as inside a shell, and above which
it counts as outside: beyond the end of an open shell. In the plane of the opening it is one half; points near
that plane do not count, or the primitive would end before the skin does."""


class Shape:
    """Signed distance to a skin, from its samples: exact to second order in their spacing near the skin."""

    def __init__(self, skin: Skin) -> None:
        self._skin = skin
        self._tree = cKDTree(skin.points)
        self._spacing = 2.5 * float(np.sqrt(skin.area / len(skin.points)))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance of points to the skin, negative inside, shape (N,) [m]."""
        far, near = self._nearest(points, 3)
        offset = points[:, None, :] - self._skin.points[near]
        height = np.einsum("nkj,nkj->nk", offset, self._skin.normals[near])
        sign = np.where(height.sum(axis=1) >= 0.0, 1.0, -1.0)
        # Near the skin, the height above the facet; far from it, the distance to the sample.
        on_facet = np.abs(height[:, 0]) > 0.7 * far[:, 0]
        return np.asarray(np.where(on_facet | (far[:, 0] > self._spacing), sign * far[:, 0], height[:, 0]))

    def exposure(self, points: np.ndarray) -> np.ndarray:
        """Exposure of the skin nearest to each point, shape (N,)."""
        return np.asarray(self._skin.exposure[self._nearest(points, 1)[1][:, 0]])

    def _nearest(self, points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        far, near = self._tree.query(points, k=list(range(1, count + 1)))
        return np.asarray(far), np.asarray(near)


def make_target(skin: Skin, around: Surroundings, count: int, rng: np.random.Generator) -> Target:
    """Samples on the skin, above it, below it and around it, in random order.

    On the skin, the required distance is zero. Above it, the distance must not be smaller than the true one,
    otherwise a primitive protrudes. Below it, it must not be positive, otherwise there is a void whose walls
    could be mistaken for a touchable surface. Shells are often open where a neighbour is mounted: inside and
    outside are distinguished there by visibility. Space that the neighbours shut in may be filled: nothing
    can be touched there.
    """
    shape = Shape(skin)
    air = np.maximum(skin.exposure, _HIDDEN_AIR)
    weight = np.maximum(skin.exposure, _HIDDEN)
    chosen = rng.choice(len(skin.points), size=min(count, len(skin.points)), replace=False)
    points, normals = skin.points[chosen], skin.normals[chosen]
    hidden = around.enclosed(points + _ABOVE * normals, rng)
    parts = [
        (points[which], np.zeros(which.sum()), mode, weight[chosen][which])
        for which, mode in ((~hidden, EQUAL), (hidden, AT_MOST))
    ]
    for height in (rng.uniform(0.001, 0.01, len(points)), 10.0 ** rng.uniform(-2.3, -1.2, len(points))):
        above = points + height[:, None] * normals
        d = shape.distance(above)
        keep = d > 0.9 * height
        shut_in = np.where(around.enclosed(above, rng), _SHUT_IN, 1.0)
        parts.append((above[keep], d[keep], AT_LEAST, 0.3 * (shut_in * air[chosen])[keep]))
    for depth in (rng.uniform(0.001, 0.006, len(points)), rng.uniform(0.004, 0.02, len(points))):
        below = points - depth[:, None] * normals
        keep = shape.distance(below) < -0.8 * depth
        wanted = -np.minimum(depth[keep] / 2.0, 0.003)
        parts.append((below[keep], wanted, AT_MOST, 0.5 * weight[chosen][keep]))
    low, high = skin.points.min(axis=0) - 0.03, skin.points.max(axis=0) + 0.03
    places = rng.uniform(low, high, size=(2 * count, 3))
    d = shape.distance(places)
    far = np.abs(d) > 0.003
    places, d = places[far], d[far]
    freedom = around.freedom(places, rng)
    outside, inside = (d > 0.0) | (freedom > _OUTSIDE), (d <= 0.0) & (freedom < _INSIDE)
    exposed = shape.exposure(places)
    shut_in = np.where(around.enclosed(places, rng), _SHUT_IN, 1.0)
    free = (shut_in * np.maximum(exposed, _HIDDEN_AIR))[outside]
    parts.append((places[outside], np.abs(d[outside]), AT_LEAST, 0.2 * free))
    exposed = np.maximum(exposed, _HIDDEN)
    parts.append((places[inside], np.full(inside.sum(), -0.001), AT_MOST, 0.2 * exposed[inside]))
    order = rng.permutation(sum(len(part[0]) for part in parts))
    weights = np.concatenate([part[3] for part in parts])[order]
    return Target(
        points=np.concatenate([part[0] for part in parts])[order],
        value=np.concatenate([part[1] for part in parts])[order],
        mode=np.concatenate([np.full(len(part[0]), part[2], dtype=np.int64) for part in parts])[order],
        weight=weights / weights.sum(),
    )
