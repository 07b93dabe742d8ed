"""Bodies of the cell: their primitives in the base frame, against coordinates transformed by SciPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.robots.primitives import Box, Sphere
from contactsense.robots.surface.union import distances
from contactsense.robots.surroundings import Body, pack_bodies


def test_bodies_are_placed_in_the_base_frame() -> None:
    box = Box(center=(0.1, 0.0, 0.0), rpy=(0.0, 0.3, 0.0), half=(0.2, 0.1, 0.05), rounding=0.01)
    sphere = Sphere(center=(0.0, 0.2, 0.0), radius=0.1)
    turned = Body(name="turned", translation=(1.0, -0.5, 0.2), rpy=(0.4, -0.2, 1.1), primitives=(box, sphere))
    surfaces = pack_bodies((Body(name="plain", primitives=(sphere,)), turned))
    assert surfaces.start.tolist() == [0, 3]
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
    inverse = Rotation.from_euler("xyz", turned.rpy).inv()
    own = inverse.apply(points - turned.translation)
    unmoved = pack_bodies((Body(name="unmoved", primitives=(box, sphere)),))
    expected = np.minimum(
        distances(unmoved, own)[0], np.linalg.norm(points - sphere.center, axis=1) - sphere.radius
    )
    np.testing.assert_allclose(distances(surfaces, points)[0], expected, atol=1e-12)
