"""Delays of the force/torque sensors of a scene."""

from contactsense.scene import Scene


def sensor_delays(scene: Scene) -> dict[str, float]:
    """Field of each force/torque sensor of the scene -> the delay of its readings [s]."""
    base = {} if scene.base_wrench is None else {"base_wrench": scene.base_wrench.delay}
    return base | {field: sensor.delay for field, sensor in scene.link_sensors.items()}


def without_delays(scene: Scene) -> Scene:
    """The scene by which readings stay in the row in which they were received: for recordings, and for
    calibration, which estimates the delays."""
    base, wrist = (
        None if sensor is None else sensor.model_copy(update={"delay": 0.0})
        for sensor in (scene.base_wrench, scene.wrist_wrench)
    )
    links = tuple(sensor.model_copy(update={"delay": 0.0}) for sensor in scene.link_wrenches)
    return scene.model_copy(update={"base_wrench": base, "wrist_wrench": wrist, "link_wrenches": links})
