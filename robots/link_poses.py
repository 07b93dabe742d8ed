"""Poses of the links at given joint angles: simple and slow, for pictures and for fitting."""

import numpy as np

from contactsense.robots.robot import Joint, Robot


def joint_pose(joint: Joint, angle: float) -> np.ndarray:
    """Pose (4, 4) of the child link of a joint in its parent link.

    Args:
        joint: The joint.
        angle: Its angle [rad].
    """
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = joint.rotation @ turn, joint.translation
    return pose


def link_poses(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Poses of all links in the base frame, shape (links, 4, 4).

    Args:
        robot: The arm.
        q: Joint angles, shape (n,) [rad].

    Raises:
        ValueError: the number of angles differs from the number of joints.
    """
    if np.shape(q) != (len(robot.joints),):
        raise ValueError(f"{robot.name} has {len(robot.joints)} joints, got {np.size(q)} angles")
    poses = [np.eye(4)]
    for joint, angle in zip(robot.joints, q, strict=True):
        poses.append(poses[-1] @ joint_pose(joint, float(angle)))
    return np.array(poses)


def poses_of_link(robot: Robot, q: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses of one link at many joint angles, in one pass.

    Args:
        robot: The arm.
        q: Joint angles, shape (N, n) [rad].
        link: Index of the link, the base being 0.

    Returns:
        Orientations, shape (N, 3, 3), and origins, shape (N, 3) [m], in the base frame.
    """
    rotation, origin = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for joint, angles in zip(robot.joints[:link], q.T, strict=False):
        x, y, z = joint.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine, versine = np.sin(angles)[:, None, None], 1.0 - np.cos(angles)[:, None, None]
        turn = np.eye(3) + sine * cross + versine * (cross @ cross)
        origin = origin + rotation @ joint.translation
        rotation = rotation @ (joint.rotation @ turn)
    return rotation, origin
