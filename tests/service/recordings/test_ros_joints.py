"""ROS 2 messages as drivers and grippers publish them: joints in another order, on a shared topic."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Scene
from contactsense.service.cli.analyze import analyze
from contactsense.service.recordings import ColumnMapping, RecordingError, read

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

SCENE = Scene(robot="ur5e")
ARM = [joint.name for joint in SCENE.robot.joints]
N = 100
Q, QD, TORQUE = (k + np.random.default_rng(2).random((N, 6)) for k in range(3))
OF_UR = [1, 2, 3, 4, 5, 0]
"""The order in which Universal Robots' driver publishes the joints."""


def _bag(
    folder: Path,
    message: Callable[[int], Sequence[tuple[list[str], np.ndarray, np.ndarray, np.ndarray]]],
    wrench: str = "",
) -> Path:
    """A bag with the messages of each of N moments; `wrench`: the type of the one on /base_wrench."""
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds: Any = store.types
    with rosbag2.Writer(folder, version=9) as writer:
        kind = "sensor_msgs/msg/JointState"
        joints = writer.add_connection("/joint_states", kind, typestore=store)
        for i in range(N):
            stamp = 10**9 + 2_000_000 * i
            header = kinds["std_msgs/msg/Header"](
                kinds["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), ""
            )
            for names, *values in message(i):
                state = kinds[kind](header, names, *values)
                writer.write(joints, stamp, store.serialize_cdr(state, kind))
        if wrench:
            base = writer.add_connection("/base_wrench", wrench, typestore=store)
            vector = kinds["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            writer.write(base, 10**9, store.serialize_cdr(kinds[wrench](vector, vector), wrench))
    return folder


def _arm(i: int, prefix: str = "") -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    return [prefix + ARM[k] for k in OF_UR], Q[i, OF_UR], QD[i, OF_UR], TORQUE[i, OF_UR]


def _check(path: Path, mapping: ColumnMapping | None = None) -> None:
    found = read(path, SCENE, mapping)
    np.testing.assert_array_equal(found.q, Q)
    np.testing.assert_array_equal(found.qd, QD)
    np.testing.assert_array_equal(found.joint_torque, TORQUE)


@pytest.mark.parametrize("prefix", ["", "left_"])
def test_the_joints_are_found_by_their_names(tmp_path: Path, prefix: str) -> None:
    _check(_bag(tmp_path / "bag", lambda i: [_arm(i, prefix)]))


def test_further_joints_are_left_out(tmp_path: Path) -> None:
    def with_finger(i: int) -> Any:
        names, *values = _arm(i)
        return [(["finger", *names], *(np.r_[9.0, part] for part in values))]

    _check(_bag(tmp_path / "bag", with_finger))


def test_messages_of_a_gripper_on_the_same_topic_are_left_out(tmp_path: Path) -> None:
    finger = (["finger"], np.ones(1), np.zeros(1), np.zeros(0))
    _check(_bag(tmp_path / "bag", lambda i: [finger, _arm(i)]))


def test_names_that_are_not_those_of_the_arm(tmp_path: Path) -> None:
    """As many as the arm has: in its order; more, or those of two arms: which are meant has to be said."""
    own = [f"axis_{k}" for k in range(6)]
    _check(_bag(tmp_path / "six", lambda i: [(own, Q[i], QD[i], TORQUE[i])]))
    seven = _bag(
        tmp_path / "seven", lambda i: [(["lift", *own], *(np.r_[9.0, v[i]] for v in (Q, QD, TORQUE)))]
    )
    with pytest.raises(
        RecordingError, match=r"expected the joints shoulder_pan_joint, .* got lift, axis_0, "
    ):
        read(seven, SCENE)
    _check(seven, ColumnMapping(joint_names=tuple(own)))

    def two_arms(i: int) -> Any:
        (left, *values), (right, *_) = _arm(i, "left_"), _arm(i, "right_")
        return [(right + left, *(np.r_[9.0 + v, v] for v in values))]

    two = _bag(tmp_path / "two", two_arms)
    with pytest.raises(RecordingError, match=r"joint_names: \[A, B\] in a YAML file"):
        read(two, SCENE)
    _check(two, ColumnMapping(joint_names=tuple(f"left_{name}" for name in ARM)))


def test_a_wrench_without_a_time_is_named(tmp_path: Path) -> None:
    bag = _bag(tmp_path / "bag", lambda i: [_arm(i)], "geometry_msgs/msg/Wrench")
    with pytest.raises(
        RecordingError, match=r"expected WrenchStamped messages on /base_wrench, found .*Wrench"
    ):
        read(bag, SCENE)


def test_a_rosbag2_folder_is_one_recording_and_takes_columns(tmp_path: Path) -> None:
    """A dataset, which is a folder as well, takes none."""
    bag = _bag(tmp_path / "bag", lambda i: [_arm(i)])
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    arguments = [str(bag), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(analyze, [*arguments, "--columns", "joint_states=/other"])
    assert result.exit_code == 1
    assert "expected JointState messages on /other, found /joint_states" in result.output
    CliRunner().invoke(analyze, arguments)
    assert (tmp_path / "out" / "report.html").exists()
