"""The skin of a scene's links, for `detail: skin`."""

import numpy as np

from contactsense.robots import RobotError
from contactsense.robots.extras import install_command
from contactsense.robots.surface.signed_distance_grid import Grids, Skin
from contactsense.scene import Scene, SceneError


def skin_of(scene: Scene) -> Grids:
    """Signed-distance grids of the scene's robot; empty unless the scene sets `detail: skin`.

    The first call builds them from the meshes, about a minute per arm; later calls read them from the cache.

    Raises:
        SceneError: the meshes or the packages to read them are missing, or the cache cannot be written.
    """
    if scene.detail != "skin":
        return _no_skin()
    try:
        from contactsense.robots.decomposition.mesh_sources import skin_grids
    except ImportError as error:
        raise SceneError(
            f"detail: skin needs the extra packages: {install_command('geometry')} ({error})"
        ) from None
    try:
        grids = skin_grids(scene.robot, scene.meshes)
    except RobotError as error:
        raise SceneError(f"meshes: {error}") from None
    # A plain read-only array has the same type for the kernels as the empty one of a scene without skin.
    values = np.asarray(grids.values)
    values.setflags(write=False)
    shape = grids.shape.copy()
    if any(body.role == "pedestal" for body in scene.bodies):
        # The line of action of a push on the pedestal may cross the base link behind it.
        shape[0] = 0
    return grids._replace(values=values, shape=shape)


def skin_argument(scene: Scene) -> Skin:
    """`skin_of` as the argument of kernels."""
    skin = skin_of(scene)
    return skin.values, skin.start, skin.shape, skin.low, skin.cell


def _no_skin() -> Grids:
    values = np.zeros(0, dtype=np.float32)
    values.setflags(write=False)
    return Grids(values, np.zeros(1, dtype=np.int64), np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3)), 1.0)
