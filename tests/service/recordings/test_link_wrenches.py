"""Force/torque sensors between links in recordings: written as they were read, and read again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import LinkWrenchSensor, Sample, Scene, WrenchSensor
from contactsense.robots.link_poses import link_poses
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.service.recordings import ColumnMapping, RecordingError, RecordingFile, read
from contactsense.service.recordings.export import export, write_columns
from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.recordings.writing.sample_rows import SampleRows
from contactsense.service.sensors.clients.robot_stream import RobotRecord
from contactsense.types import Estimate

N = 40
ELBOW = LinkWrenchSensor(
    name="elbow", link="forearm", rpy=(0.1, 0.2, 0.3), translation=(0.0, 0.01, 0.05), sign="sensor_on_arm",
    bias=(1, 2, 3, 0.1, 0.2, 0.3),
)  # fmt: skip
PLAIN = LinkWrenchSensor(name="shoulder", link="upper_arm")
SCENE = Scene(robot="ur5e", base_wrench=None, link_wrenches=[ELBOW, PLAIN])
CHANCE = np.random.default_rng(1)
T, Q = 0.002 * np.arange(N), CHANCE.uniform(-2.0, 2.0, (N, 6))
READING = {name: CHANCE.standard_normal((N, 6)) for name in ("elbow", "shoulder")}


def columns(**more: np.ndarray) -> dict[str, np.ndarray]:
    groups = {"actual_q": Q, "actual_qd": np.zeros((N, 6)), "joint_torque": np.ones((N, 6))}
    groups |= {f"{name}_wrench": values for name, values in READING.items()}
    named = {f"{name}_{i}": values[:, i] for name, values in groups.items() for i in range(6)}
    return {"timestamp": T, **named, **more}


def in_base_axes(sensor: LinkWrenchSensor, q: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """By the poses of the links alone."""
    place = link_poses(SCENE.robot, q)[SCENE.robot.link_names.index(sensor.link)]
    turn = place[:3, :3] @ sensor.rotation
    origin = place[:3, 3] + place[:3, :3] @ np.array(sensor.translation)
    read = (reading - sensor.bias) * (1.0 if sensor.sign == "arm_on_sensor" else -1.0)
    force = turn @ read[:3]
    return np.concatenate((force, turn @ read[3:] + np.cross(origin, force)))


def expected(sensor: LinkWrenchSensor) -> np.ndarray:
    return np.array([in_base_axes(sensor, q, r) for q, r in zip(Q, READING[sensor.name], strict=True)])


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_file_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"recording{suffix}"
    write_columns(path, columns())
    found = read(path, SCENE)
    assert found.problems == ()
    for sensor in (ELBOW, PLAIN):
        np.testing.assert_allclose(found.link_wrenches[sensor.name], expected(sensor), atol=1e-9)
    assert "link_wrenches.elbow" in repr(found)
    sample = list(found.samples())[7]
    np.testing.assert_allclose((sample.link_wrenches or {})["elbow"], expected(ELBOW)[7], atol=1e-9)
    (block,) = found.sample_blocks()
    np.testing.assert_allclose((block.link_wrenches or {})["shoulder"], expected(PLAIN), atol=1e-9)
    parts = list(RecordingFile(path, SCENE).blocks(7))
    whole = np.concatenate([part.link_wrenches["elbow"] for part in parts])
    np.testing.assert_allclose(whole, expected(ELBOW), atol=1e-9)


def test_columns_may_have_other_names_or_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "recording.parquet"
    renamed = {name.replace("elbow_wrench", "ft"): values for name, values in columns().items()}
    write_columns(path, renamed)
    for mapping in (ColumnMapping(link_wrenches={"elbow": ("ft",)}), "link_wrenches.elbow=ft"):
        found = read(path, SCENE, mapping)
        np.testing.assert_allclose(found.link_wrenches["elbow"], expected(ELBOW), atol=1e-9)
    found = read(path, SCENE)
    assert set(found.link_wrenches) == {"shoulder"}
    assert any("link_wrenches.elbow is not used" in problem.message for problem in found.problems)
    del renamed["shoulder_wrench_3"]
    write_columns(path, renamed)
    with pytest.raises(RecordingError, match=r"link_wrenches\.shoulder: expected a column shoulder_wrench_3"):
        read(path, SCENE)


def test_a_value_that_is_not_finite_is_told_and_missing(tmp_path: Path) -> None:
    path, wrong = tmp_path / "recording.parquet", READING["elbow"][:, 2].copy()
    wrong[5] = np.nan
    write_columns(path, columns(elbow_wrench_2=wrong))
    found = read(path, SCENE)
    assert [problem.row_from for problem in found.problems] == [5]
    samples = list(found.samples())
    assert "elbow" not in (samples[5].link_wrenches or {})
    assert "elbow" in (samples[6].link_wrenches or {})


def test_the_delay_is_taken_off(tmp_path: Path) -> None:
    """Of the reading in the sensor's own frame: the arm has moved since."""
    late = SCENE.model_copy(update={"link_wrenches": (ELBOW.model_copy(update={"delay": 0.004}),)})
    path = tmp_path / "recording.parquet"
    write_columns(path, columns())
    found = read(path, late)
    earlier = [in_base_axes(ELBOW, Q[i], READING["elbow"][i + 2]) for i in range(N - 2)]
    np.testing.assert_allclose(found.link_wrenches["elbow"][:-2], earlier, atol=1e-9)


def test_there_and_back(tmp_path: Path) -> None:
    """What is exported without a scene is in base axes."""
    first, second = tmp_path / "first.parquet", tmp_path / "second.csv"
    write_columns(first, columns())
    found = read(first, SCENE)
    export(found, second)
    table = found.columns()
    np.testing.assert_array_equal(table["elbow_wrench_4"], found.link_wrenches["elbow"][:, 4])
    assert "shoulder_wrench_5" in second.read_text().splitlines()[0]


def _sample(i: int) -> Sample:
    values = {sensor.name: expected(sensor)[i] for sensor in (ELBOW, PLAIN)}
    return Sample(float(T[i]), Q[i], np.zeros(6), np.ones(6), link_wrenches=values)


@pytest.mark.slow
def test_the_recorder_writes_what_the_sensors_read(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, SCENE)
    slices = {"actual_q": slice(0, 6), "actual_qd": slice(6, 12)}
    for i in range(N):
        record = RobotRecord(float(T[i]), i * 2_000_000, (*Q[i], *np.zeros(6)))
        recorder.robot(record, slices, None, 0.0, _sample(i))
    (path,) = recorder.close()
    found = read(path)
    for sensor in (ELBOW, PLAIN):
        np.testing.assert_allclose(found.link_wrenches[sensor.name], expected(sensor), atol=1e-9)


def test_the_rows_of_the_service_are_those_that_the_sensors_read() -> None:
    rows = SampleRows(SCENE)
    table = np.empty((3, len(rows.names)))
    none = Estimate(0.0, "none", (), np.zeros(7), np.zeros(6), np.zeros((6, 6)))
    for i in range(3):
        rows.fill(table[i], _sample(i), none)
    table = rows.stored(table)
    for name, values in READING.items():
        own = [rows.names.index(f"{name}_wrench_{k}") for k in range(6)]
        np.testing.assert_allclose(table[:, own], values[:3], atol=1e-9)
    assert (table[:, rows.names.index("status")] == 0.0).all()


@pytest.mark.slow
def test_a_wrist_sensor_in_a_recording_of_the_service_is_read_as_any_other(tmp_path: Path) -> None:
    wrist = WrenchSensor(rpy=(0.2, -0.3, 0.4), translation=(0.0, 0.01, 0.02), sign="sensor_on_arm")
    scene = SCENE.model_copy(update={"wrist_wrench": wrist})
    rows, frame = SampleRows(scene), LinkSensorFrame(scene, "wrist_wrench")
    values = frame.wrenches(Q, READING["elbow"])
    table = np.empty((N, len(rows.names)))
    none = Estimate(0.0, "none", (), np.zeros(7), np.zeros(6), np.zeros((6, 6)))
    for i in range(N):
        rows.fill(table[i], replace(_sample(i), wrist_wrench=values[i]), none)
    path = tmp_path / "clip.parquet"
    write_columns(path, dict(zip(rows.names, rows.stored(table).T, strict=True)))
    found = read(path, scene)
    assert not found.problems
    np.testing.assert_allclose(found.wrist_wrench, values, atol=1e-9)
    np.testing.assert_allclose(found.link_wrenches["elbow"], expected(ELBOW), atol=1e-9)
