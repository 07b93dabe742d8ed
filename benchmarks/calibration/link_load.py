"""Recordings of an arm with something on one of its links."""

from dataclasses import replace

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.calibration.simulate import arm_of
from contactsense.calibration import FreeMotion
from contactsense.robots import Inertia, Link
from contactsense.robots.tool import join_inertia
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.service.mock.arm.newton_euler import inverse_dynamics


def with_load(scene: Scene, recording: FreeMotion, link: str, mass: float, place: np.ndarray) -> FreeMotion:
    """A recording of joint torques and base sensor as if the link had carried a load.

    Args:
        scene: The cell without the load.
        recording: Of that cell; joint positions, velocities and torques as its sensors mean them.
        link: Name of the link.
        mass: Of the load [kg].
        place: Where it is, as a point, in the link's frame, shape (3,) [m].
    """
    assert scene.base_wrench is not None
    assert recording.torque is not None
    assert recording.reading is not None
    arm, links = arm_of(scene), list(arm_of(scene).links)
    number = scene.robot.link_names.index(link)
    load = Inertia(mass, place, np.zeros((3, 3)))
    links[number] = Link(link, join_inertia(links[number].inertia, load))
    qdd = np.gradient(recording.qd, recording.t, axis=0)
    (torque, wrench), (loaded_torque, loaded_wrench) = (
        inverse_dynamics(own, recording.q, recording.qd, qdd, (), tuple(scene.gravity_base))
        for own in (arm, replace(arm, links=tuple(links)))
    )
    # What the load adds does not pass through the sensor's bias.
    sensor = WrenchMap.of(scene.base_wrench.model_copy(update={"bias": (0.0,) * 6}))
    return replace(
        recording,
        torque=recording.torque + loaded_torque - torque,
        reading=recording.reading + sensor.reading(loaded_wrench - wrench),
    )
