"""Inertia of the scene's tool where the arm carries it."""

from contactsense.robots import Inertia
from contactsense.robots.robot import NO_MASS
from contactsense.robots.tool import move_inertia
from contactsense.scene import Scene


def tool_in_last_link(scene: Scene) -> Inertia:
    """Inertia of the tool in the last link's frame; zero without a tool."""
    if scene.tool is None:
        return NO_MASS
    return move_inertia(scene.tool.inertia, scene.robot.flange_rotation, scene.robot.flange_translation)
