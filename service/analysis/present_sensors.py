"""The scene of a recording that lacks some of the scene's sensors.

A sensor that is silent throughout would make every estimate `degraded`, nothing could be said of the model,
and contacts would not be estimated from all of their samples.
"""

from contactsense.scene import Scene
from contactsense.service.recordings import Recording, RecordingFile


def in_scene(scene: Scene) -> dict[str, bool]:
    """Field of each sensor, in the order of `contactsense.sensors.sample_fields.SampleFields.names`, and
    whether the scene has it."""
    return {
        "base_wrench": scene.base_wrench is not None,
        "joint_torque": scene.joint_torque is not None,
        **dict.fromkeys(scene.link_sensors, True),
    }


def absent_sensors(recording: Recording | RecordingFile, scene: Scene) -> frozenset[str]:
    """Fields of the scene's sensors that the recording does not have."""
    return frozenset(field for field, there in in_scene(scene).items() if there) - recording.sensors


def silent_sensors(recording: Recording | RecordingFile, scene: Scene) -> frozenset[str]:
    """Fields of the scene's sensors that the recording has, but without a single reading; none if that is so
    for all of them, as there is no reading at all then.

    Raises:
        RecordingError: The recording has no sample that can be used.
    """
    there = recording.sensors & {field for field, own in in_scene(scene).items() if own}
    silent = set(there)
    # Whoever is heard in the first block, as usual, is not looked for any further.
    for block in [recording] if isinstance(recording, Recording) else recording.blocks():
        silent -= block.heard
        if not silent:
            break
    return frozenset(silent) if silent < there else frozenset()


def without_sensors(scene: Scene, fields: frozenset[str]) -> Scene:
    """The scene without these sensors; weights are picked up only where it has all that this needs."""
    if not fields:
        return scene
    changes: dict[str, object] = {
        field: None for field in ("joint_torque", "base_wrench", "wrist_wrench") if field in fields
    }
    left = tuple(s for s in scene.link_wrenches if f"link_wrenches.{s.name}" not in fields)
    picks_up = scene.picks_up and not fields & {"joint_torque", "base_wrench"}
    return scene.model_copy(update={**changes, "link_wrenches": left, "picks_up": picks_up})
