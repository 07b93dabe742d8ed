"""The arm's own weight on the sensor below it, in any posture: what a plausible reading is compared with."""

import numpy as np

from contactsense.robots.link_poses import link_poses
from contactsense.scene import Scene
from contactsense.scene_model.arm_model import model_with_tool


class ArmWeight:
    """Weight of the arm of one scene, its tool included."""

    def __init__(self, scene: Scene) -> None:
        """Take mass distribution and gravity from `scene`."""
        model = model_with_tool(scene)
        self._robot, self._gravity = scene.robot, scene.gravity_base
        self._masses, self._com = model.mass, model.com
        self.mass = float(model.mass.sum())
        """Mass of arm and tool [kg]."""
        self.force = self.mass * self._gravity
        """Its weight, base axes, shape (3,) [N]."""

    def wrench(self, q: np.ndarray) -> np.ndarray:
        """Wrench of the arm at rest on what carries it, base axes, about the base origin, shape (6,) [N, Nm].

        Args:
            q: Joint positions, shape (n,) [rad].
        """
        poses = link_poses(self._robot, q)
        centres = np.einsum("lij,lj->li", poses[:, :3, :3], self._com) + poses[:, :3, 3]
        return np.concatenate((self.force, np.cross(self._masses @ centres, self._gravity)))
