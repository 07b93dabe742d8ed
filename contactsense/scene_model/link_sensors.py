"""Link sensors: the force/torque sensors within the arm, where they sit and what they carry.

A sensor between two links carries the distal one and everything beyond it, the wrist sensor the tool. Apart
from that they are alike.
"""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.robots import Inertia
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.robot import NO_MASS
from contactsense.robots.tool import move_inertia
from contactsense.scene import Scene
from contactsense.sensors.settings import WrenchSensor


class Mount(NamedTuple):
    """Place and load of one link sensor."""

    settings: WrenchSensor
    body: int
    """Index of the link in whose frame the sensor's is given, the base being 0."""
    rotation: np.ndarray
    """Orientation of the sensor's frame in that of the link, shape (3, 3)."""
    origin: np.ndarray
    """Its origin in that of the link, shape (3,) [m]."""
    first_link: int
    """First link on which the sensor measures contacts, a tool being one beyond the last."""
    first_body: int
    """First of the arm's links that it carries, the tool being a part of the last; their number: none."""
    load: Inertia
    """What else it carries, fixed to `body`, in that link's frame."""


class LinkSensors(NamedTuple):
    """The same of all S link sensors, for the kernels."""

    body: Annotated[Integers, "link_sensors"]
    """See `Mount`."""
    origin: Annotated[Floats, "link_sensors, 3"]
    """[m]"""
    first_body: Annotated[Integers, "link_sensors"]
    mass: Annotated[Floats, "link_sensors"]
    """Mass of the load [kg]."""
    com: Annotated[Floats, "link_sensors, 3"]
    """Its centre of mass [m]."""
    inertia: Annotated[Floats, "link_sensors, 3, 3"]
    """Its inertia about that [kg m^2]."""


def tool_in_last_link(scene: Scene) -> Inertia:
    """Inertia of the tool in the last link's frame; zero without a tool."""
    if scene.tool is None:
        return NO_MASS
    return move_inertia(scene.tool_inertia, scene.robot.flange_rotation, scene.robot.flange_translation)


def mounts(scene: Scene) -> dict[str, Mount]:
    """Place and load of each of `Scene.link_sensors`, in that order."""
    robot, found = scene.robot, {}
    for sensor in scene.link_wrenches:
        link = robot.link_names.index(sensor.link)
        found[f"link_wrenches.{sensor.name}"] = Mount(
            sensor, link, sensor.rotation, np.array(sensor.translation), link, link,
            NO_MASS,
        )  # fmt: skip
    wrist, links = scene.wrist_wrench, len(robot.links)
    if wrist is not None:
        rotation = robot.flange_rotation
        found["wrist_wrench"] = Mount(
            wrist, links - 1, rotation @ wrist.rotation,
            rotation @ np.array(wrist.translation) + robot.flange_translation, links, links,
            tool_in_last_link(scene),
        )  # fmt: skip
    return found


def link_sensors(scene: Scene) -> LinkSensors:
    """The link sensors of a scene."""
    found = list(mounts(scene).values())
    return LinkSensors(
        body=np.array([mount.body for mount in found], dtype=np.int64),
        origin=np.array([mount.origin for mount in found]).reshape(-1, 3),
        first_body=np.array([mount.first_body for mount in found], dtype=np.int64),
        mass=np.array([mount.load.mass for mount in found], dtype=np.float64),
        com=np.array([mount.load.com for mount in found]).reshape(-1, 3),
        inertia=np.array([mount.load.tensor for mount in found]).reshape(-1, 3, 3),
    )
