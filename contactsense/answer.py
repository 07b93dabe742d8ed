"""From the kernels' arrays to an `Estimate`."""

import numpy as np

from contactsense.arm import Arm
from contactsense.pipeline import Memory
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Status

LEAST_PROBABILITY = 0.01
"""Explanations less probable than this are not listed."""


class Composer:
    """Makes estimates for one scene."""

    def __init__(self, scene: Scene, arm: Arm) -> None:
        """Names and frames of `scene` are looked up once."""
        self._names = scene.link_names
        self._clear = scene.clear
        self._arm = arm
        self._flange = (scene.robot.flange_rotation, scene.robot.flange_translation)
        self._joints = arm.model.joints

    def quiet(self, t: float, status: Status, reason: str = "") -> Estimate:
        """No contact, or no answer."""
        links = len(self._names)
        return Estimate(t, status, (), np.zeros(links), np.zeros(6), np.zeros((6, 6)), reason)

    def contacts(self, t: float, memory: Memory, count: int, reason: str = "") -> Estimate:
        """The explanations that the kernels left in `memory`; with a `reason` the estimate is `degraded`."""
        if count == 0:
            why = "something pushes or pulls the arm, but no push on a touchable link explains it"
            return self.quiet(t, "degraded" if reason else "ambiguous", f"{reason}; {why}" if reason else why)
        found = memory.found
        listed = [
            self._contact(memory, row)
            for row in found.order[:count].tolist()
            if found.probability[row] >= LEAST_PROBABILITY
        ]
        best = listed[0]
        status: Status = "contact" if best.probability >= self._clear else "ambiguous"
        return Estimate(
            t,
            "degraded" if reason else status,
            tuple(listed),
            memory.link_probability.copy(),
            memory.hypotheses.wrench[best.link_index].copy(),
            memory.hypotheses.covariance[best.link_index].copy(),
            reason,
        )

    def _contact(self, memory: Memory, row: int) -> Contact:
        found = memory.found
        surfaces = self._arm.surfaces
        link = int(surfaces.link[row])
        point = found.point[row].copy()
        return Contact(
            link=self._names[link],
            link_index=link,
            primitive=row - int(surfaces.start[link]),
            probability=float(found.probability[row]),
            point=self.in_link(memory.motion.rotation, memory.motion.origin, link, point),
            point_base=point,
            normal_base=found.normal[row].copy(),
            force_base=found.force[row].copy(),
            torsion=float(found.torsion[row]),
            covariance=found.covariance[row].copy(),
        )

    def in_link(self, rotation: np.ndarray, origin: np.ndarray, link: int, point: np.ndarray) -> np.ndarray:
        """A base-frame point in the frame of a link; in the flange's frame for the tool.

        Args:
            rotation, origin: Poses of the bodies in the base frame, shapes (n + 1, 3, 3) and (n + 1, 3) [m].
            link: Number of the link.
            point: Shape (3,) [m].
        """
        body = min(link, self._joints)
        local = (point - origin[body]) @ rotation[body]
        if link > self._joints:
            local = (local - self._flange[1]) @ self._flange[0]
        return np.asarray(local)
