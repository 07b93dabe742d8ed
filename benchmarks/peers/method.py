"""Interface of all methods in the benchmarks: arrays in, arrays out."""

from typing import NamedTuple, Protocol

import numpy as np

from contactsense import Localizer, Scene
from contactsense.static_localizer import Method as Decision


class Answers(NamedTuple):
    """Estimates of N measurements, base frame."""

    link: np.ndarray
    """Index of the touched link, base 0, -1 for no estimate, shape (N,), int64."""
    point_base: np.ndarray
    """Contact point, base frame, shape (N, 3) [m]."""
    link_probability: np.ndarray | None = None
    """Probability of each link, shape (N, links); None if the method has none."""


class Method(Protocol):
    """A method that locates contacts of an arm at rest, built from a `contactsense.Scene`."""

    name: str
    """For tables and pictures."""

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        """Answer N measurements, each by itself.

        Args:
            q: Joint positions, shape (N, n) [rad].
            base_wrench: External wrench that the base sensor sees, base axes, base origin, shape (N, 6) [N,
                Nm]; None without that sensor. A contact wrench w leaves w.
            joint_torque: External part of the torque of each actuator, shape (N, n) [Nm]; None without that
                sensor. A contact wrench w leaves -s_j . w.
        """
        ...


class Located:
    """`contactsense.Localizer` as a method."""

    def __init__(self, scene: Scene, decision: Decision = "joint") -> None:
        """Compile for that scene."""
        self.name = f"contactsense, {scene.detail}"
        self._localizer = Localizer(scene, decision)

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        batch = self._localizer.locate_batch(q, base_wrench=base_wrench, joint_torque=joint_torque, jobs=1)
        return Answers(batch.link, batch.point_base, batch.link_probability)
