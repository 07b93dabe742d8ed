"""Constructed truth: postures with one to three pushes on exposed places of the primitives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contactsense import Scene
from contactsense.arm import Arm, build_arm
from kinematics.core import place
from kinematics.model import empty_motion
from robots.surface import project

Links = Literal["different", "same"]
Lean = Literal["cone", "normal"]

ROOM = 0.005
"""Room that a finger needs above a place [m]."""
APART = 0.05
"""Least distance of two contacts on one link [m]."""
TRIES = 500
"""Places that are drawn for one posture before another is taken."""


@dataclass(frozen=True)
class Push:
    """One contact; base frame."""

    link: int
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    torsion: float

    @property
    def wrench(self) -> np.ndarray:
        """About the base origin, shape (6,) [N, Nm]."""
        return np.concatenate((self.force, np.cross(self.point, self.force) + self.torsion * self.normal))


@dataclass(frozen=True)
class Trial:
    """A posture and its contacts, in the order in which they arrive."""

    q: np.ndarray
    pushes: tuple[Push, ...]
    screw: np.ndarray
    """Joint screws, shape (n, 6)."""

    def measure(self, pushes: Sequence[Push]) -> tuple[np.ndarray, np.ndarray]:
        """External base wrench (6,) and joint torques (n,) while those pushes act, without noise."""
        base = np.sum([push.wrench for push in pushes], axis=0)
        torque = np.zeros(len(self.screw))
        for push in pushes:
            torque[: push.link] -= self.screw[: push.link] @ push.wrench
        return base, torque


class Trials:
    """Draws trials on the arm of one scene."""

    def __init__(self, scene: Scene, seed: int) -> None:
        """`seed` settles all that is drawn."""
        self._scene = scene
        self._arm: Arm = build_arm(scene)
        self._motion = empty_motion(self._arm.model.joints)
        self._chance = np.random.default_rng(seed)
        self._primitive = np.repeat(np.arange(len(self._arm.surfaces.kind)), np.diff(self._arm.places.start))

    def draw(self, count: int, force: float, links: Links, lean: Lean) -> Trial:
        """A random posture with `count` pushes of `force` newtons, on places spread evenly over the area.

        Args:
            count: Number of contacts.
            force: Size of each force [N].
            links: Whether they are all on different links or all on one.
            lean: `cone`: directions spread evenly over the friction disc; `normal`: square to the surface.
        """
        while True:
            q = self._chance.uniform(-np.pi, np.pi, self._arm.model.joints)
            place(self._arm.model, q, self._motion)
            pushes: list[Push] = []
            for _ in range(TRIES):
                push = self._push(force, lean)
                if push is not None and all(_fits(push, other, links) for other in pushes):
                    pushes.append(push)
                if len(pushes) == count:
                    return Trial(q, tuple(pushes), self._motion.screw.copy())

    def _push(self, size: float, lean: Lean) -> Push | None:
        """One push, or None where the drawn place cannot be touched."""
        arm, chance = self._arm, self._chance
        s = int(chance.choice(len(self._primitive), p=np.exp(arm.places.log_share)))
        p = int(self._primitive[s])
        near = arm.places.point[s] + arm.places.spread[s] * chance.standard_normal(3)
        local = arm.surfaces.rotation[p].T @ (near - arm.surfaces.origin[p])
        found = project(arm.surfaces.kind[p], arm.surfaces.size[p], *local)
        link = int(arm.surfaces.link[p])
        body = arm.sensors.depth[link]
        R = self._motion.rotation[body] @ arm.surfaces.rotation[p]
        o = self._motion.rotation[body] @ arm.surfaces.origin[p] + self._motion.origin[body]
        point, normal = R @ np.array(found[1:4]) + o, R @ np.array(found[4:7])
        if (link == 0 and point[2] < ROOM) or not self._free(point + ROOM * normal):
            return None
        torsion = self._scene.torsion * size * chance.standard_normal()
        return Push(link, point, normal, self._force(normal, size, lean), torsion)

    def changed(self, push: Push, drift: float | None, lean: Lean) -> Push:
        """The push a while later.

        Its force has changed by about `drift` in each component, or, with None, become another one of the
        same size [N].
        """
        size = float(np.linalg.norm(push.force))
        if drift is None:
            return replace(push, force=self._force(push.normal, size, lean))
        return replace(push, force=push.force + drift * self._chance.standard_normal(3))

    def _force(self, normal: np.ndarray, size: float, lean: Lean) -> np.ndarray:
        force = -normal
        if lean == "cone":
            across = np.cross(normal, self._chance.standard_normal(3))
            ratio = self._scene.friction * np.sqrt(self._chance.random())
            force = force + ratio * across / np.linalg.norm(across)
        return np.asarray(force * (size / np.linalg.norm(force)))

    def _free(self, point: np.ndarray) -> bool:
        """Whether a point is outside all primitives of the arm."""
        surfaces = self._arm.surfaces
        for p in range(len(surfaces.kind)):
            body = self._arm.sensors.depth[surfaces.link[p]]
            R, o = self._motion.rotation[body], self._motion.origin[body]
            local = surfaces.rotation[p].T @ (R.T @ (point - o) - surfaces.origin[p])
            if project(surfaces.kind[p], surfaces.size[p], *local)[0] < 0.9 * ROOM:
                return False
        return True


def _fits(push: Push, other: Push, links: Links) -> bool:
    """Whether two pushes may act in one trial."""
    if links == "different":
        return push.link != other.link
    return push.link == other.link and bool(np.linalg.norm(push.point - other.point) >= APART)
