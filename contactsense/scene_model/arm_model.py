"""The model of a scene's arm: its links as the scene has them, with the tool."""

import numpy as np

from contactsense.kinematics.model import Model, build_model
from contactsense.robots import Link, Robot
from contactsense.robots.tool import join_inertia
from contactsense.scene import Scene
from contactsense.scene_model.link_sensors import tool_in_last_link


def model_with_tool(scene: Scene) -> Model:
    """Kinematics and inertia of the scene's arm, the tool joined to the last link."""
    robot = scene.robot
    inertia = scene.link_inertia
    inertia[-1] = join_inertia(inertia[-1], tool_in_last_link(scene))
    robot_with_tool = Robot(
        name=robot.name,
        links=tuple(Link(link.name, body) for link, body in zip(robot.links, inertia, strict=True)),
        joints=robot.joints,
    )
    model = build_model(robot_with_tool)
    if scene.joint_torque is not None and scene.joint_torque.rotor_inertia is not None:
        model = model._replace(rotor_inertia=np.array(scene.joint_torque.rotor_inertia))
    return model
