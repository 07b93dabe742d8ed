"""Simulated contacts for a benchmark: random postures, places on the skin, forces, and the sensors'
readings."""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.skin_table import Table, scattered, spread
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, empty_motion
from contactsense.robots.surface.union import distances
from contactsense.scene_model.constants import build_constants

ROOM = 0.02
"""Required distance above a touched place that is free of other links and of the mounting plane [m]."""
OPEN = 0.4
"""Required fraction of the directions above it that are free up to `REACH`."""
REACH = 0.04
"""Reach of a finger [m]."""
_TRIES = 16
_RAYS = 20
_APART = 0.03
"""Spacing of the points at which self-collision is checked [m]."""


class Touches(NamedTuple):
    """N postures with K simultaneous contacts each; base axes."""

    q: np.ndarray
    """Joint positions, shape (N, n) [rad]."""
    link: np.ndarray
    """Shape (N, K), int64."""
    point_base: np.ndarray
    """Shape (N, K, 3) [m]."""
    normal_base: np.ndarray
    """Outward unit normals, shape (N, K, 3)."""
    force_base: np.ndarray
    """Forces on the robot, shape (N, K, 3) [N]."""
    base_wrench: np.ndarray
    """Contribution of each contact to the base wrench, shape (N, K, 6) [N, Nm]."""
    joint_torque: np.ndarray
    """Contribution of each contact to the actuators' torques, shape (N, K, n) [Nm]."""


def sensed(motion: Motion, link: int, point: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Effect of one force on the sensors.

    Args:
        motion: Poses of the links.
        link: Number of the touched link.
        point, force: Base frame, shapes (3,) [m, N].

    Returns:
        External base wrench (6,), and external part of the actuators' torques (n,).
    """
    wrench = np.concatenate((force, np.cross(point, force)))
    torque = -motion.screw @ wrench
    torque[link:] = 0.0
    return wrench, torque


class Toucher:
    """Draws postures of an arm and contacts on it."""

    def __init__(self, scene: Scene, skin: Table | None = None, seed: int = 0) -> None:
        """For the touchable links of a scene's arm.

        Args:
            scene: The arm; its primitives define the obstacles.
            skin: Points for contacts, uniform by area; None: on the primitives themselves.
            seed: Random seed.
        """
        arm = build_constants(scene)
        whole = build_constants(scene.model_copy(update={"touchable": None, "link_prior": "area"}))
        self._rng = np.random.default_rng(seed)
        self._scene, self._model, self._surfaces = scene, arm.model, whole.surfaces
        self._motion = empty_motion(arm.model.joints)
        self._skin = skin if skin is not None else scattered(arm.surfaces, 50000.0, seed)
        touchable = arm.touchable.astype(bool)
        self._share = np.where(touchable, self._skin.area, 0.0)
        self._directions = self._rng.normal(size=(_RAYS, 3))
        self._directions /= np.linalg.norm(self._directions, axis=1, keepdims=True)
        self._coarse = spread(self._surfaces, _APART)
        self._limits = np.array([joint.range_within_turn for joint in scene.robot.joints])

    def draw(self, count: int, contacts: int = 1, force: float = 20.0, even: bool = False) -> Touches:
        """Postures free of collision, each touched at `contacts` different links.

        Links are drawn in proportion to their area, or all with equal probability (`even`); places uniform by
        area where there is room for a finger; forces of that magnitude [N] uniform over the disc that the
        scene's friction allows.
        """
        share = (self._share > 0.0).astype(float) if even else self._share
        parts = [self._posture(share.copy(), contacts, force) for _ in range(count)]
        return Touches(*(np.array(column) for column in zip(*parts, strict=True)))

    def beside(self, q: np.ndarray, taken: int, contacts: int, force: float) -> Touches:
        """Further contacts in a posture with an existing contact, as `draw` with `even`; N is 1.

        Args:
            q: Shape (n,) [rad].
            taken: Index of the link that is already touched.
            contacts: Number of contacts, on different links other than that one.
            force: Magnitude of each force [N].
        """
        forward_kinematics(self._model, q, self._motion)
        share = (self._share > 0.0).astype(float)
        share[taken] = 0.0
        return Touches(*(column[None] for column in self._touch(q, share, contacts, force)))

    def _posture(self, share: np.ndarray, contacts: int, force: float) -> tuple[np.ndarray, ...]:
        return self._touch(self._free(), share, contacts, force)

    def _touch(self, q: np.ndarray, share: np.ndarray, contacts: int, force: float) -> tuple[np.ndarray, ...]:
        """Contacts in the posture of `_motion`, as one run of `Touches`."""
        chosen: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]] = []
        while len(chosen) < contacts:
            link = int(self._rng.choice(len(share), p=share / share.sum()))
            found = self._place_on(link)
            if found is None:
                continue
            share[link] = 0.0
            chosen.append((link, *found, self._push(found[1], force)))
        link_, point, normal, push = (np.array(column) for column in zip(*chosen, strict=True))
        felt = [sensed(self._motion, k, p, f) for k, p, f in zip(link_, point, push, strict=True)]
        wrench, torque = (np.array(column) for column in zip(*felt, strict=True))
        return q, link_, point, normal, push, wrench, torque

    def _free(self) -> np.ndarray:
        while True:
            q = self._rng.uniform(*self._limits.T)
            forward_kinematics(self._model, q, self._motion)
            point, _ = in_base(self._motion, self._coarse)
            link = self._coarse.link
            if (point[link > 1, 2] > 0.0).all() and not self._collides(point, link):
                return np.asarray(q)

    def _collides(self, point: np.ndarray, link: np.ndarray) -> bool:
        for other in range(len(self._surfaces.start) - 1):
            far = np.abs(link - other) > 1
            if (self._distance(other, point[far]) < 0.0).any():
                return True
        return False

    def _distance(self, link: int, point: np.ndarray) -> np.ndarray:
        body = min(link, len(self._motion.origin) - 1)  # a tool's surface is given in the last link's frame
        local = (point - self._motion.origin[body]) @ self._motion.rotation[body]
        return np.asarray(distances(self._surfaces, local, link)[0])

    def _room(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        free = self._free_at(point + ROOM / 4.0 * normal) & self._free_at(point + ROOM * normal)
        opening = np.zeros(len(point))
        for direction in self._directions:
            # A uniform point on a unit sphere that touches the surface gives cosine-weighted directions.
            way = normal + direction
            way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
            opening += self._free_at(point + REACH / 2.0 * way) & self._free_at(point + REACH * way)
        return np.asarray(free & (opening >= OPEN * len(self._directions)))

    def _free_at(self, point: np.ndarray) -> np.ndarray:
        free = point[:, 2] > 0.0
        for link in range(len(self._surfaces.start) - 1):
            free &= self._distance(link, point) > 0.0
        return np.asarray(free)

    def _place_on(self, link: int) -> tuple[np.ndarray, np.ndarray] | None:
        """A place on a link with free space above it; None if a few tries find none."""
        own = np.flatnonzero(self._skin.link == link)
        chosen = self._rng.choice(own, _TRIES)
        skin = self._skin
        tries = Table(skin.point[chosen], skin.normal[chosen], skin.link[chosen], skin.area)
        point, normal = in_base(self._motion, tries)
        free = np.flatnonzero(self._room(point, normal))
        return (point[free[0]], normal[free[0]]) if len(free) else None

    def _push(self, normal: np.ndarray, size: float) -> np.ndarray:
        aside = np.cross(normal, self._rng.normal(size=3))
        aside *= self._scene.friction * np.sqrt(self._rng.random()) / np.linalg.norm(aside)
        direction = aside - normal
        return np.asarray(size * direction / np.linalg.norm(direction))


def in_base(motion: Motion, table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Places and normals of a table in the base frame, shapes (M, 3)."""
    body = np.minimum(table.link, len(motion.origin) - 1)  # a tool's places are in the last link's frame
    rotation = motion.rotation[body]
    point = np.einsum("nij,nj->ni", rotation, table.point) + motion.origin[body]
    return point, np.einsum("nij,nj->ni", rotation, table.normal)
