"""Kinematic calibration of one real arm, applied to a model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from contactsense.robots.errors import RobotError
from contactsense.robots.files.file_model import FileModel
from contactsense.robots.link_poses import link_poses
from contactsense.robots.robot import Robot
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.yaml_schema import check, read_yaml

FAR = 0.05
"""If a calibrated joint is further than this from the model's, the calibration belongs to another arm [m]."""


class _Place(FileModel):
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float


class _Calibration(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    kinematics: dict[str, _Place | str]


def calibrated(robot: Robot, path: str | Path) -> Robot:
    """A model with the joint poses of one real arm, as exported by UR's driver (`calibration_correction`).

    Masses and surfaces are those of the model; they differ from the real arm much less than the joints.

    Args:
        robot: The model.
        path: YAML with `kinematics: {<link>: {x, y, z, roll, pitch, yaw}}`, the pose in its parent link of
            the joint that carries each link [m, rad].

    Raises:
        RobotError: the file is unusable, a link is missing or unknown, or a joint differs so much that the
            file must belong to another arm.
    """
    path = Path(path)
    places = check(_Calibration, read_yaml(path, "the kinematic calibration"), path).kinematics
    given = {name: place for name, place in places.items() if not isinstance(place, str)}
    names = robot.link_names[1:]
    for name in given:
        if name not in names:
            raise RobotError(
                f"{path}: kinematics.{name}: {robot.name} has no such link; it has {', '.join(names)}"
            )
    joints = []
    for name, joint in zip(names, robot.joints, strict=True):
        if name not in given:
            raise RobotError(f"{path}: kinematics.{name}: missing")
        place = given[name]
        translation = np.array([place.x, place.y, place.z])
        rotation = rotation_from_rpy((place.roll, place.pitch, place.yaw))
        joints.append(replace(joint, translation=translation, rotation=rotation))
    _check_near(robot, replace(robot, joints=tuple(joints)), path)
    return replace(robot, joints=tuple(joints))


def _check_near(model: Robot, real: Robot, path: Path) -> None:
    """Compare joint axes as lines at zero angles: if two axes are nearly parallel, a calibration may shift a
    joint's frame along its axis by metres without changing the motion of the arm."""
    zero = np.zeros(len(model.joints))
    poses = zip(link_poses(model, zero)[1:], link_poses(real, zero)[1:], strict=True)
    for joint, other, (pose, place) in zip(model.joints, real.joints, poses, strict=True):
        axis, apart = pose[:3, :3] @ joint.axis, place[:3, 3] - pose[:3, 3]
        off = float(np.linalg.norm(apart - (apart @ axis) * axis))
        turned = float(np.degrees(np.arccos(np.clip(axis @ place[:3, :3] @ other.axis, -1.0, 1.0))))
        if off > FAR or turned > 5.0:
            where = f"{path}: {other.name}"
            raise RobotError(
                f"{where}: {off * 1e3:.0f} mm and {turned:.1f} deg off {model.name}: another arm's file?"
            )
