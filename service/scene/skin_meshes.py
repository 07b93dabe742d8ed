"""Whether the meshes of a scene with `detail: skin` are there."""

from contactsense.robots import RobotError
from contactsense.robots.extras import install_command
from contactsense.scene import Scene, SceneError


def check_meshes(scene: Scene) -> None:
    """Look for the links' meshes, as far as the scene needs them; their skin is not computed.

    Raises:
        SceneError: They are missing or of another arm, or the packages to read them are missing; the message
            names the field.
    """
    if scene.detail != "skin":
        return
    try:
        from contactsense.robots.decomposition.mesh_sources import skin_meshes
    except ImportError as error:
        raise SceneError(
            f"detail: skin needs the extra packages: {install_command('geometry')} ({error})"
        ) from None
    try:
        skin_meshes(scene.robot, scene.meshes)
    except RobotError as error:
        raise SceneError(f"meshes: {error}") from None
