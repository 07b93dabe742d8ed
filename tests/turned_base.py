"""The same cell in another base frame: one that is turned about the first joint's axis."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense import Scene
from contactsense.calibration import FreeMotion


def turned_base(scene: Scene, part: FreeMotion, angle: float = 0.9) -> tuple[Scene, FreeMotion]:
    """The first joint has an angle more, by so much [rad] the base is turned back about its z axis: mounting,
    pose of the base sensor and positions differ, and the readings are the same."""
    back, sensor = Rotation.from_euler("z", angle), scene.base_wrench
    mounting = scene.orientation * back.inv()
    update: dict[str, object] = {"mounting": tuple(mounting.as_euler("xyz").tolist())}
    if sensor is not None:
        axes = back * Rotation.from_matrix(sensor.rotation)
        pose = {
            "rpy": tuple(axes.as_euler("xyz").tolist()),
            "translation": tuple(back.apply(sensor.translation).tolist()),
        }
        update["base_wrench"] = sensor.model_copy(update=pose)
    q = part.q + angle * np.eye(part.q.shape[1])[0]
    return scene.model_copy(update=update), replace(part, q=q)
