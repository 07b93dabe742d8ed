"""Which forces the sensors of a scene do not determine, in words: where forces and limits are shown."""

from contactsense.scene import Scene
from contactsense.scene_model.link_sensors import mounts


def undetermined_forces(scene: Scene) -> str:
    """What the forces of contacts mean on links whose contacts no force/torque sensor measures; empty if
    there is no such link.

    Args:
        scene: The scene without the sensors that the recording lacks.
    """
    carried = min((mount.first_link for mount in mounts(scene).values()), default=len(scene.link_names))
    names = [name for name in scene.link_names[:carried] if name in scene.touchable_links]
    if scene.base_wrench is not None or not names:
        return ""
    where = "" if carried >= len(scene.link_names) else f" on {', '.join(names)}"
    if scene.joint_torque is None:
        return f"No sensor measures pushes{where}: they are not listed."
    proximal = [name for name in scene.link_names[:2] if name in names]
    least = f", as on {' and '.join(proximal)}," if proximal else ""
    return (
        f"No force/torque sensor measures pushes{where}, and joint torques alone do not determine a force: "
        "the stated ones are the most probable, and the true ones may be several times as large. Pushes that "
        f"load the joints little{least} may not be listed at all."
    )
