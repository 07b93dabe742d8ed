"""Poses of the links at given joint positions: simple and slow, for pictures and for fitting."""

import numpy as np

from contactsense.robots.robot import Joint, Robot
from contactsense.robots.rotations import cross_matrix


def joint_pose(joint: Joint, angle: float | np.ndarray) -> np.ndarray:
    """Poses of the child link of a joint in its parent link, shape (..., 4, 4).

    Args:
        joint: The joint.
        angle: Its positions as angles, shape (...) [rad].
    """
    cross, angles = cross_matrix(joint.axis), np.asarray(angle)[..., None, None]
    pose = np.zeros((*np.shape(angle), 4, 4))
    turn = np.eye(3) + np.sin(angles) * cross + (1.0 - np.cos(angles)) * (cross @ cross)
    pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = joint.rotation @ turn, joint.translation, 1.0
    return pose


def link_poses(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Poses of all links in the base frame, shape (..., links, 4, 4).

    Args:
        robot: The arm.
        q: Joint positions, shape (..., n) [rad].

    Raises:
        ValueError: the number of positions differs from the number of joints.
    """
    q = np.asarray(q)
    if q.shape[-1:] != (len(robot.joints),):
        raise ValueError(f"{robot.name} has {len(robot.joints)} joints, got positions of shape {q.shape}")
    poses = [np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4))]
    for j, joint in enumerate(robot.joints):
        poses.append(poses[-1] @ joint_pose(joint, q[..., j]))
    return np.stack(poses, axis=-3)
