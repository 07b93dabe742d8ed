"""Poses of the links beside one: obstacles for a finger on it."""

from collections.abc import Mapping

import numpy as np
import trimesh

from contactsense.robots.link_poses import joint_pose
from contactsense.robots.robot import Joint, Robot

_PLATE = 3.0
"""Edge length of the plate that represents the mounting surface of a base [m]."""


def neighbour_poses(
    robot: Robot, meshes: Mapping[str, trimesh.Trimesh], link: int, count: int = 8, seed: int = 0
) -> list[list[trimesh.Trimesh]]:
    """Meshes of the links before and after one, and of the plate below the base, in possible relative poses.

    Args:
        robot: Provides the joints.
        meshes: Mesh of each link, by name; links without one are left out.
        link: Number of the link.
        count: Number of poses, joint positions at random within their limits.
        seed: Seed of the angles.

    Returns:
        Meshes in the frame of `link`, one list for each pose.
    """
    rng = np.random.default_rng(seed)
    names = robot.link_names
    poses = []
    for _ in range(count):
        near = []
        if link > 0 and names[link - 1] in meshes:
            motion = np.linalg.inv(joint_pose(robot.joints[link - 1], _angle(robot.joints[link - 1], rng)))
            near.append(meshes[names[link - 1]].copy().apply_transform(motion))
        if link < len(robot.joints) and names[link + 1] in meshes:
            motion = joint_pose(robot.joints[link], _angle(robot.joints[link], rng))
            near.append(meshes[names[link + 1]].copy().apply_transform(motion))
        if link == 0:
            plate = trimesh.creation.box((_PLATE, _PLATE, 0.001))
            near.append(plate.apply_translation((0.0, 0.0, float(meshes[names[0]].bounds[0, 2]) - 0.0006)))
        poses.append(near)
    return poses


def _angle(joint: Joint, rng: np.random.Generator) -> float:
    return float(rng.uniform(*joint.range_within_turn))
