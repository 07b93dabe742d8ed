"""Simulated ground truth: postures with one to three pushes on accessible points of the primitives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from contactsense import Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.robots.surface.convex_primitives import project
from contactsense.scene_model.constants import Constants, build_constants

Links = Literal["different", "same"]

CLEARANCE = 0.005
"""Clearance that a finger needs above a point [m]."""
MIN_SEPARATION = 0.05
"""Minimum distance of two contacts on one link [m]."""
MAX_DRAWS = 500
"""Number of points drawn for one posture before another is drawn."""


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
        """`seed` is the random seed."""
        self._scene = scene
        self._constants: Constants = build_constants(scene)
        self._motion = empty_motion(self._constants.model.joints)
        self._rng = np.random.default_rng(seed)
        self._primitive = np.repeat(
            np.arange(len(self._constants.surfaces.kind)), np.diff(self._constants.samples.start)
        )

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, the base first."""
        return tuple(self._scene.link_names)

    def draw(self, count: int, force: float, links: Links) -> Trial:
        """A random posture with `count` pushes of `force` newtons, on points uniform over the surface
        area.

        Args:
            count: Number of contacts.
            force: Magnitude of each force [N].
            links: Whether all are on different links or all on one.
        """
        while True:
            q = self._rng.uniform(-np.pi, np.pi, self._constants.model.joints)
            forward_kinematics(self._constants.model, q, self._motion)
            pushes: list[Push] = []
            for _ in range(MAX_DRAWS):
                push = self._push(force)
                if push is not None and all(_fits(push, other, links) for other in pushes):
                    pushes.append(push)
                if len(pushes) == count:
                    return Trial(q, tuple(pushes), self._motion.screw.copy())

    def push_at(self, q: np.ndarray, force: float) -> tuple[Push, np.ndarray, np.ndarray]:
        """One push at joint positions q [rad], and rotation (3, 3) and origin (3,) [m] of the pushed link."""
        forward_kinematics(self._constants.model, q, self._motion)
        push = None
        while push is None:
            push = self._push(force)
        body = self._constants.sensors.depth[push.link]
        return push, self._motion.rotation[body].copy(), self._motion.origin[body].copy()

    def _push(self, size: float) -> Push | None:
        """One push, or None where the drawn place cannot be touched."""
        arm, chance = self._constants, self._rng
        s = int(chance.choice(len(self._primitive), p=np.exp(arm.samples.log_share)))
        p = int(self._primitive[s])
        near = arm.samples.point[s] + arm.samples.spread[s] * chance.standard_normal(3)
        local = arm.surfaces.rotation[p].T @ (near - arm.surfaces.origin[p])
        found = project(arm.surfaces.kind[p], arm.surfaces.size[p], *local)
        link = int(arm.surfaces.link[p])
        body = arm.sensors.depth[link]
        R = self._motion.rotation[body] @ arm.surfaces.rotation[p]
        o = self._motion.rotation[body] @ arm.surfaces.origin[p] + self._motion.origin[body]
        point, normal = R @ np.array(found[1:4]) + o, R @ np.array(found[4:7])
        if (link == 0 and point[2] < CLEARANCE) or not self._free(point + CLEARANCE * normal):
            return None
        torsion = self._torsion(size)
        return Push(link, point, normal, self._force(normal, size), torsion)

    def _torsion(self, size: float) -> float:
        return float(self._scene.torsion * size * self._rng.standard_normal())

    def changed(self, push: Push, drift: float | None) -> Push:
        """The push at a later time.

        Its force has changed by about `drift` in each component and is still in the friction cone: others
        would pull or slip. Or, with None, it has become another one of the same size [N].
        """
        size = float(np.linalg.norm(push.force))
        if drift is None:
            return replace(push, force=self._force(push.normal, size))
        while True:  # until it is in the cone, as the push itself is
            force = push.force + drift * self._rng.standard_normal(3)
            normal_force = -float(force @ push.normal)
            across = float(np.linalg.norm(force + normal_force * push.normal))
            if across <= self._scene.friction * normal_force:
                return replace(push, force=force)

    def _force(self, normal: np.ndarray, size: float) -> np.ndarray:
        """A force whose direction is uniform over the friction disc."""
        across = np.cross(normal, self._rng.standard_normal(3))
        ratio = self._scene.friction * np.sqrt(self._rng.random())
        force = ratio * across / np.linalg.norm(across) - normal
        return np.asarray(force * (size / np.linalg.norm(force)))

    def _free(self, point: np.ndarray) -> bool:
        """Whether a point is outside all primitives of the arm."""
        surfaces = self._constants.surfaces
        for p in range(len(surfaces.kind)):
            body = self._constants.sensors.depth[surfaces.link[p]]
            R, o = self._motion.rotation[body], self._motion.origin[body]
            local = surfaces.rotation[p].T @ (R.T @ (point - o) - surfaces.origin[p])
            if project(surfaces.kind[p], surfaces.size[p], *local)[0] < 0.9 * CLEARANCE:
                return False
        return True


def _fits(push: Push, other: Push, links: Links) -> bool:
    """Whether two pushes may act in one trial."""
    if links == "different":
        return push.link != other.link
    return push.link == other.link and bool(np.linalg.norm(push.point - other.point) >= MIN_SEPARATION)
