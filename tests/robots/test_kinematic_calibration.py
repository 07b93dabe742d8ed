"""The calibration of one real arm on top of a model."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from contactsense import robots
from contactsense.robots.kinematic_calibration import calibrated
from contactsense.robots.link_poses import link_poses
from tests.shared import shared


def places(robot: robots.Robot, **changes: dict[str, float]) -> dict[str, object]:
    """The model's own kinematics in the form of a calibration, with changes by link."""
    result: dict[str, object] = {"hash": "calib_1"}
    for name, joint in zip(robot.link_names[1:], robot.joints, strict=True):
        R = joint.rotation
        place = {
            "x": float(joint.translation[0]),
            "y": float(joint.translation[1]),
            "z": float(joint.translation[2]),
            "roll": float(np.arctan2(R[2, 1], R[2, 2])),
            "pitch": float(-np.arcsin(np.clip(R[2, 0], -1, 1))),
            "yaw": float(np.arctan2(R[1, 0], R[0, 0])),
        }
        result[name] = place | changes.get(name, {})
    return result


def write(path: Path, kinematics: dict[str, object]) -> Path:
    path.write_text(yaml.safe_dump({"kinematics": kinematics}))
    return path


def test_the_models_own_numbers_change_nothing(tmp_path: Path) -> None:
    robot = robots.load("ur5e")
    same = calibrated(robot, write(tmp_path / "c.yaml", places(robot)))
    for q in np.random.default_rng(0).uniform(-3, 3, size=(5, 6)):
        np.testing.assert_allclose(link_poses(same, q), link_poses(robot, q), atol=1e-8)


def test_small_corrections_move_the_arm_and_nothing_else(tmp_path: Path) -> None:
    robot = robots.load("ur5e")
    real = calibrated(robot, write(tmp_path / "c.yaml", places(robot, forearm={"x": -0.4262, "yaw": 0.002})))
    assert real.joints[2].translation[0] == -0.4262
    assert real.joints[2].torque_limit == robot.joints[2].torque_limit
    assert real.links is robot.links


@pytest.mark.parametrize("link", ["shoulder", "forearm", "wrist_2"])
def test_a_link_is_where_the_file_says(tmp_path: Path, link: str) -> None:
    """In its parent's frame, turned by roll, pitch and yaw about fixed axes, then by the joint."""
    robot, chance = robots.load("ur5e"), np.random.default_rng(1)
    given = {k: v for k, v in places(robot).items() if k != "hash"}
    near = {
        name: {k: v + chance.uniform(-0.01, 0.01) for k, v in place.items()} for name, place in given.items()
    }  # type: ignore[attr-defined]
    real = calibrated(robot, write(tmp_path / "c.yaml", near))
    q, i = chance.uniform(-3.0, 3.0, 6), robot.link_names.index(link)
    poses, place = link_poses(real, q), near[link]
    turn = Rotation.from_euler("xyz", [place["roll"], place["pitch"], place["yaw"]])
    joint = Rotation.from_rotvec(q[i - 1] * robot.joints[i - 1].axis)
    parent = poses[i - 1]
    np.testing.assert_allclose(poses[i][:3, :3], parent[:3, :3] @ (turn * joint).as_matrix(), atol=1e-12)
    origin = parent[:3, :3] @ [place["x"], place["y"], place["z"]] + parent[:3, 3]
    np.testing.assert_allclose(poses[i][:3, 3], origin, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("link", "name", "size", "refused"),
    [
        ("forearm", "x", 0.049, ""),
        ("forearm", "x", 0.051, "51 mm and 0.0 deg off ur5e"),
        ("wrist_3", "roll", np.radians(4.9), ""),
        ("wrist_3", "roll", np.radians(5.1), "0 mm and 5.1 deg off ur5e"),
        ("forearm", "z", 3.0, ""),  # along its axis, where nothing changes
    ],
)
def test_how_far_a_joint_may_be_from_the_models(
    tmp_path: Path, link: str, name: str, size: float, sign: float, refused: str
) -> None:
    robot = robots.load("ur5e")
    own: dict[str, float] = places(robot)[link]  # type: ignore[assignment]
    changes = {link: {name: float(own[name] + sign * size)}}
    if name == "z":
        after: dict[str, float] = places(robot)["wrist_1"]  # type: ignore[assignment]
        changes["wrist_1"] = {"z": after["z"] - sign * size}
    path = write(tmp_path / "c.yaml", places(robot, **changes))
    if not refused:
        assert calibrated(robot, path).links is robot.links
        return
    with pytest.raises(robots.RobotError, match=refused):
        calibrated(robot, path)


def test_the_makers_default_file_is_of_that_form() -> None:
    robot = robots.load("ur10e")
    same = calibrated(robot, shared("ur_description/config/ur10e/default_kinematics.yaml"))
    q = np.array([0.1, -1.0, 1.2, 0.3, -0.4, 2.0])
    np.testing.assert_allclose(link_poses(same, q), link_poses(robot, q), atol=1e-12)


def test_wrong_files_are_refused(tmp_path: Path) -> None:
    robot, path = robots.load("ur5e"), tmp_path / "c.yaml"
    with pytest.raises(robots.RobotError, match=r"c.yaml: elbow_joint: 188 mm .*ur5e: another arm's file"):
        calibrated(robot, write(path, places(robots.load("ur10e"), shoulder={"z": 0.1625})))
    with pytest.raises(robots.RobotError, match=r"kinematics.elbow: ur5e has no such link; it has shoulder"):
        calibrated(robot, write(path, {"elbow": places(robot)["forearm"]}))
    some = places(robot)
    del some["wrist_2"]
    with pytest.raises(robots.RobotError, match=r"kinematics.wrist_2: missing"):
        calibrated(robot, write(path, some))
    with pytest.raises(robots.RobotError, match=r"kinematics.forearm.*x"):
        calibrated(robot, write(path, places(robot, forearm={"x": float("nan")})))
