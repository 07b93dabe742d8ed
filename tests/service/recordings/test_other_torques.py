"""Recordings that are read with another torque signal, sign or constants than they were made with."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Sample, Scene
from contactsense.service.recordings import read
from contactsense.service.recordings.metadata import metadata
from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.recordings.writing.segment_writer import SegmentWriter
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from tests.service.recordings.recorded_tables import TORQUES, as_parquet, columns, table

N = 20
CONSTANTS = np.array([10.0, 10.7, 8.46, 9.0, 9.48, 10.12])
CURRENT = np.random.default_rng(1).standard_normal((N, 6))


def scene_of(**changes: Any) -> Scene:
    sensor = {"signal": "actual_current", "torque_constants": tuple(CONSTANTS), **changes}
    return Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(**sensor))


def recorded(folder: Path, scene: Scene, torque: np.ndarray) -> Path:
    """A recording of currents, as `contactsense record` writes it."""
    recorder = Recorder(folder, scene)
    slices = {"actual_q": slice(0, 6), "actual_qd": slice(6, 12), "actual_current": slice(12, 18)}
    for i, current in enumerate(CURRENT):
        record = RobotRecord(0.002 * i, i * 2_000_000, (*np.zeros(12), *current))
        recorder.robot(record, slices, None, 0.0, Sample(0.002 * i, np.zeros(6), np.zeros(6), torque[i]))
    (path,) = recorder.close()
    return path


@pytest.mark.parametrize(
    ("changes", "factor"),
    [({}, 1.0), ({"sign": "on_arm"}, -1.0), ({"torque_constants": tuple(2.0 * CONSTANTS)}, 2.0)],
    ids=["as recorded", "sign", "constants"],
)
def test_currents_are_converted_as_the_given_scene_says(
    tmp_path: Path, changes: dict[str, Any], factor: float
) -> None:
    """`check` names a line of the scene, and has to accept the same recording when that is corrected."""
    path = recorded(tmp_path, scene_of(), CONSTANTS * CURRENT)
    found = read(path, scene_of(**changes))
    np.testing.assert_array_equal(found.joint_torque, factor * CONSTANTS * CURRENT)
    assert not found.problems


def test_a_signal_that_was_not_recorded_is_told(tmp_path: Path) -> None:
    path = recorded(tmp_path, scene_of(), CONSTANTS * CURRENT)
    found = read(path, scene_of(signal="actual_current_as_torque"))
    np.testing.assert_array_equal(found.joint_torque, CONSTANTS * CURRENT)
    (problem,) = found.problems
    assert str(problem).startswith("joint torques are those of the scene in the file")


def test_torques_of_the_service_are_converted_to_the_given_scene(tmp_path: Path) -> None:
    """Its recordings and clips have no currents. `calibrate` multiplies the constants of its scene: with
    torques of other constants it would find wrong ones."""
    own = columns(N)
    writer = SegmentWriter(tmp_path, "service", tuple(own), metadata(scene_of(), table="service"))
    for row in zip(*own.values(), strict=True):
        writer.add(row)
    (path,) = writer.close()
    factors = np.array([2.0, 1.0, 0.5, 1.0, 1.0, 4.0])
    for changes, factor in (
        ({}, np.ones(6)),
        ({"noise": 2.0}, np.ones(6)),
        ({"sign": "on_arm"}, -np.ones(6)),
        ({"torque_constants": tuple(factors * CONSTANTS)}, factors),
    ):
        found = read(path, scene_of(**changes))
        np.testing.assert_allclose(found.joint_torque, factor * table(own, "joint_torque"), rtol=1e-12)
        assert not found.problems
    found = read(path, scene_of(signal="actual_current_as_torque"))
    np.testing.assert_array_equal(found.joint_torque, table(own, "joint_torque"))
    assert [problem.kind for problem in found.problems] == ["other_torques"]


def test_columns_of_any_other_file_are_torques_whatever_the_scene_says(tmp_path: Path) -> None:
    own = columns(N, **{f"actual_current_{i}": CURRENT[:, i] for i in range(6)})
    writer = SegmentWriter(tmp_path, "own", tuple(own), metadata(TORQUES))
    for row in zip(*own.values(), strict=True):
        writer.add(row)
    (path,) = writer.close()
    found = read(path, scene_of(sign="on_arm"))
    np.testing.assert_array_equal(found.joint_torque, table(own, "joint_torque"))
    assert not found.problems


def test_columns_that_the_scene_names_come_before_those_of_the_usual_name(tmp_path: Path) -> None:
    names = tuple(f"tau_{letter}" for letter in "abcdef")
    own = columns(N, **{name: CURRENT[:, i] for i, name in enumerate(names)})
    path = as_parquet(tmp_path, own)
    sensor = JointTorqueSensor(fields=names, sign="on_arm")
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=sensor)
    np.testing.assert_array_equal(read(path, scene).joint_torque, -CURRENT)
    np.testing.assert_array_equal(read(path, TORQUES).joint_torque, table(own, "joint_torque"))
