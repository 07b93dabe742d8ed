"""Bags whose wrenches have another topic or other times than the joint states, and those without times."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.recordings import RecordingError, read

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

SCENE = Scene(robot="ur5e")
ARM = [joint.name for joint in SCENE.robot.joints]
N = 50


def _bag(
    folder: Path, topic: str = "/base_wrench", shift: float = 0.0, joints: float = 1.0, wrenches: float = 1.0
) -> Path:
    """A bag of an arm at rest with a wrench for each joint state.

    Args:
        folder: Where it is written.
        topic: The topic of the wrenches.
        shift: By how much their clock is ahead [s].
        joints, wrenches: What the stamps are multiplied by; 0: they are not set.
    """
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds: Any = store.types
    state, stamped = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"

    def header(t: float) -> Any:
        time = kinds["builtin_interfaces/msg/Time"](int(t), round(1e9 * (t - int(t))))
        return kinds["std_msgs/msg/Header"](time, "")

    with rosbag2.Writer(folder, version=9) as writer:
        arm = writer.add_connection("/joint_states", state, typestore=store)
        base = writer.add_connection(topic, stamped, typestore=store)
        for i in range(N):
            t, row = 1000.0 + 0.002 * i, np.zeros(6)
            message = kinds[state](header(joints * t), ARM, row, row, row + i)
            writer.write(arm, round(1e9 * t), store.serialize_cdr(message, state))
            force = kinds["geometry_msgs/msg/Vector3"](0.0, 0.0, -200.0 + i)
            wrench = kinds[stamped](
                header(wrenches * (t + shift)), kinds["geometry_msgs/msg/Wrench"](force, force)
            )
            writer.write(base, round(1e9 * t), store.serialize_cdr(wrench, stamped))
    return folder


def test_a_topic_that_is_missing_is_told_with_those_that_are_there(tmp_path: Path) -> None:
    found = read(_bag(tmp_path / "bag", "/ft"), SCENE)
    (text,) = [problem.message for problem in found.problems if "no WrenchStamped" in problem.message]
    assert "messages on /base_wrench, found /ft (geometry_msgs/msg/WrenchStamped); /joint_states" in text
    assert "--columns base_wrench_topic=TOPIC" in text
    named = read(tmp_path / "bag", SCENE, "base_wrench_topic=/ft")
    assert named.base_wrench is not None
    assert not named.problems
    assert not read(tmp_path / "bag", Scene(robot="ur5e", base_wrench=None)).problems


@pytest.mark.parametrize(
    ("changes", "got"),
    [({"shift": 100.0}, "1100.000 to 1100.098 s"), ({"wrenches": 0.0}, "0.000 to 0.000 s")],
)
def test_wrenches_of_other_times_are_told(tmp_path: Path, changes: dict[str, float], got: str) -> None:
    """They were said to be missing, though each of them was there."""
    found = read(_bag(tmp_path / "bag", **changes), SCENE)
    assert any(
        "/base_wrench: expected stamps within those of /joint_states, 1000.000 to 1000.098 s, got " + got
        in problem.message
        for problem in found.problems
    )


def test_joint_states_without_times_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError,
        match=r"/joint_states: expected messages whose header\.stamp rises, got 0\.000 s in all",
    ):
        read(_bag(tmp_path / "bag", joints=0.0), SCENE)
