"""A UR5e whose links are a few plain primitives, and contacts constructed on them: truth without any mesh."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from contactsense import robots
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, build_model, empty_motion
from contactsense.robots.primitives import Capsule, Cylinder, Primitive
from contactsense.robots.surface.convex_primitives import Surfaces, pack, project


def _tube(a: tuple[float, float, float], b: tuple[float, float, float], radius: float) -> Cylinder:
    return Cylinder(a=a, b=b, radius_a=radius, radius_b=radius, rounding=0.01)


PRIMITIVES: tuple[tuple[Primitive, ...], ...] = (
    (_tube((0, 0, 0), (0, 0, 0.1), 0.075),),
    (_tube((0, 0, -0.07), (0, 0, 0.07), 0.06), _tube((0, 0, 0), (0, -0.07, 0), 0.06)),
    (
        Capsule(a=(-0.05, 0, 0.138), b=(-0.375, 0, 0.138), radius=0.05),
        _tube((0, 0, 0.07), (0, 0, 0.2), 0.06),
        _tube((-0.425, 0, 0.07), (-0.425, 0, 0.2), 0.055),
    ),
    (
        Capsule(a=(-0.05, 0, 0.007), b=(-0.34, 0, 0.007), radius=0.04),
        _tube((0, 0, -0.06), (0, 0, 0.07), 0.055),
        _tube((-0.392, 0, -0.05), (-0.392, 0, 0.06), 0.045),
    ),
    (_tube((0, 0, -0.05), (0, 0, 0.05), 0.045), _tube((0, 0, 0), (0, -0.05, 0), 0.045)),
    (_tube((0, 0, -0.05), (0, 0, 0.05), 0.045), _tube((0, 0, 0), (0, 0.05, 0), 0.045)),
    (_tube((0, 0, -0.035), (0, 0, 0), 0.0375),),
)


@cache
def plain_ur5e() -> robots.Robot:
    """The arm whose surface is `PRIMITIVES`."""
    return ur5e_of(PRIMITIVES)


def ur5e_of(primitives: Sequence[tuple[Primitive, ...]]) -> robots.Robot:
    """The arm's own kinematics and inertia, with these primitives of each link for a surface."""
    arm = robots.load("ur5e")
    links = tuple(
        robots.Link(link.name, link.inertia, shapes)
        for link, shapes in zip(arm.links, primitives, strict=True)
    )
    return robots.Robot(arm.name, links, arm.joints, arm.flange_rotation, arm.flange_translation)


def plain_ur5e_on(base: tuple[Primitive, ...]) -> robots.Robot:
    """The plain arm with other primitives of its base, which moves in no posture."""
    return ur5e_of((base, *PRIMITIVES[1:]))


@dataclass(frozen=True)
class Truth:
    """N contacts; base frame. `torque` is the external part of the actuators' torques, -s_j . w."""

    q: np.ndarray
    link: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    torsion: np.ndarray
    base_wrench: np.ndarray
    torque: np.ndarray


def contacts(
    arm: robots.Robot, count: int, seed: int, *, friction: float = 0.4, torsion: float = 0.003
) -> Truth:
    """Random postures, each with one push on an exposed place of a random link: 5 to 60 N, within the
    friction cone."""
    chance = np.random.default_rng(seed)
    model, motion, surfaces = build_model(arm), empty_motion(len(arm.joints)), pack(arm.links)
    rows: list[tuple[np.ndarray, ...]] = []
    while len(rows) < count:
        q = chance.uniform(-np.pi, np.pi, len(arm.joints))
        forward_kinematics(model, q, motion)
        p = int(chance.integers(len(surfaces.kind)))
        body = surfaces.rotation[p].T @ (chance.standard_normal(3) * 0.3)
        found = project(surfaces.kind[p], surfaces.size[p], *body)
        if found[0] <= 0.0:
            continue
        link = int(surfaces.link[p])
        R = motion.rotation[link] @ surfaces.rotation[p]
        o = motion.rotation[link] @ surfaces.origin[p] + motion.origin[link]
        point, normal = R @ np.array(found[1:4]) + o, R @ np.array(found[4:7])
        if link == 0 and point[2] < 0.01 and normal[2] < -0.4:
            continue  # the face on which the base stands
        if _clearance(surfaces, motion, point, p) < 0.004:
            continue
        push = chance.uniform(5.0, 60.0)
        tangential = np.cross(normal, chance.standard_normal(3))
        tangential *= friction * np.sqrt(chance.random()) / np.linalg.norm(tangential)
        force = push * (tangential - normal)
        xi = torsion * push * chance.uniform(-1.0, 1.0)
        wrench = np.concatenate((force, np.cross(point, force) + xi * normal))
        torque = np.where(np.arange(len(arm.joints)) < link, -motion.screw @ wrench, 0.0)
        rows.append((q, np.array(link), point, normal, force, np.array(xi), wrench, torque))
    return Truth(*(np.array(column) for column in zip(*rows, strict=True)))


def _clearance(surfaces: Surfaces, motion: Motion, point: np.ndarray, own: int) -> float:
    """Distance from a point to the nearest primitive but its own, of any link; negative inside [m]."""
    distances = []
    for p in range(len(surfaces.kind)):
        if p != own:
            link = surfaces.link[p]
            local = motion.rotation[link].T @ (point - motion.origin[link]) - surfaces.origin[p]
            distances.append(
                project(surfaces.kind[p], surfaces.size[p], *(surfaces.rotation[p].T @ local))[0]
            )
    return float(min(distances))
