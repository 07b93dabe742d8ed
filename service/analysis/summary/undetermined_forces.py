"""Which forces the sensors did not determine, in words: where forces and limits are shown."""

from collections.abc import Sequence

import pyarrow as pa

from contactsense.scene import Scene
from contactsense.scene_model.link_sensors import mounts
from contactsense.service.analysis.summary.contact_summary import ContactSummary

TOLD = 0.1
"""Share of a contact from which on a silent sensor is told: single readings are often lost."""
NAMED = 5
"""Contacts that are named."""
_LEFT = (
    "forces and impulse are those of the other samples, or of the other sensors alone, and may be far from "
    "the true ones."
)


def doubted_forces(scene: Scene, contacts: Sequence[ContactSummary]) -> str:
    """What the forces of these contacts mean where sensors did not determine them; empty where they did.

    Args:
        scene: The scene without the sensors that the recording lacks.
        contacts: Those of the recording.
    """
    return " ".join(filter(None, (undetermined_forces(scene), _silent_sensors(contacts))))


def _silent_sensors(contacts: Sequence[ContactSummary]) -> str:
    found = [each for each in contacts if each.silent > TOLD * each.duration]
    if not found:
        return ""
    named = [f"{each.contact} (at {each.begin:.3f} s, for {each.silent:.2f} s)" for each in found[:NAMED]]
    if len(found) > NAMED:
        named.append(f"{len(found) - NAMED} more (see `silent` in the table)")
    listed = named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"
    return f"A sensor was silent or settled during contact{'s' if len(found) > 1 else ''} {listed}: {_LEFT}"


def silent_sensors(contacts: pa.Table) -> str:
    """The same of a table of many contacts, as `contact_table` makes it; empty if no sensor was silent."""
    duration = contacts["duration"].to_numpy()
    count = int((contacts["silent"].to_numpy() > TOLD * duration).sum())
    if not count:
        return ""
    return (
        f"A sensor was silent or settled during {count} contact{'s' if count > 1 else ''} (see `silent` in "
        f"the table): {_LEFT}"
    )


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
