"""Recordings: what is written is read, what others write is read, what is wrong is said."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Sample, Scene, WrenchSensor
from contactsense.service.recordings.tables import (
    ColumnTable,
    RecordingError,
    read,
    samples_of,
    stretch_of,
    table_of,
    write,
)

N = 20
SCENE = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(rpy=(0.1, 0.2, 0.3), translation=(0.0, 0.0, -0.05), bias=(1, 2, 3, 4, 5, 6)),
)


def _columns(**more: np.ndarray) -> dict[str, np.ndarray]:
    chance = np.random.default_rng(1)
    names = [f"{group}_{i}" for group in ("actual_q", "actual_qd", "joint_torque") for i in range(6)]
    columns = {"timestamp": np.arange(N) * 0.002 + 100.0}
    columns |= {name: np.round(chance.standard_normal(N), 6) for name in names}
    columns |= {f"base_wrench_{i}": np.round(chance.standard_normal(N), 6) for i in range(6)}
    return columns | more


def _text(columns: dict[str, np.ndarray], delimiter: str) -> str:
    rows = [delimiter.join(columns)]
    rows += [delimiter.join(f"{value:.6f}" for value in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("name", ["a.parquet", "a.csv"])
def test_there_and_back(tmp_path: Path, name: str) -> None:
    columns = _columns(robot_mode=np.full(N, 7.0))
    write(tmp_path / name, columns)
    found = read(tmp_path / name)
    assert list(found.columns) == list(columns)  # others are kept
    for key, values in columns.items():
        np.testing.assert_array_equal(found.columns[key], values)


@pytest.mark.parametrize(("delimiter", "packed"), [(",", False), (" ", False), (",", True)])
def test_what_the_clients_of_ur_robots_write(tmp_path: Path, delimiter: str, packed: bool) -> None:
    columns, path = _columns(), tmp_path / ("a.csv.gz" if packed else "a.csv")
    text = _text(columns, delimiter).encode()
    path.write_bytes(gzip.compress(text) if packed else text)
    found = read(path)
    for key, values in columns.items():
        np.testing.assert_allclose(found.columns[key], values, atol=1e-9)


def test_rows_that_repeat_a_timestamp_are_left_out(tmp_path: Path) -> None:
    columns = _columns()
    columns["timestamp"][5:7] = columns["timestamp"][4]
    write(tmp_path / "a.csv", columns)
    found = read(tmp_path / "a.csv")
    assert (found.repeated, len(found.t)) == (2, N - 2)
    assert np.all(np.diff(found.t) > 0.0)
    assert found.columns["actual_q_0"][4] == columns["actual_q_0"][4]


def test_samples_become_a_recording_and_samples_again(tmp_path: Path) -> None:
    chance = np.random.default_rng(2)
    samples = [
        Sample(0.002 * i, *chance.standard_normal((3, 6)), base_wrench=chance.standard_normal(6))
        for i in range(N)
    ]
    write(tmp_path / "a.parquet", table_of(samples, SCENE))
    for before, after in zip(samples, samples_of(read(tmp_path / "a.parquet"), SCENE), strict=True):
        assert after.t == before.t
        assert before.base_wrench is not None
        assert after.base_wrench is not None
        assert before.joint_torque is not None
        np.testing.assert_array_equal(after.q, before.q)
        np.testing.assert_array_equal(after.joint_torque, before.joint_torque)
        np.testing.assert_allclose(after.base_wrench, before.base_wrench, atol=1e-12)


def test_the_scene_chooses_the_torques() -> None:
    def torque(sensor: JointTorqueSensor) -> np.ndarray:
        scene = Scene(robot="ur10e", base_wrench=None, joint_torque=sensor)
        found = stretch_of(read_from(columns), scene).torque
        assert found is not None
        return found

    columns = _columns(**{f"actual_current_{i}": np.full(N, 2.0) for i in range(6)})
    columns |= {f"target_current_{i}": np.full(N, 0.5) for i in range(6)}
    columns |= {f"output_double_register_{24 + i}": np.full(N, float(i)) for i in range(6)}
    names = tuple(f"output_double_register_{24 + i}" for i in range(6))
    given = np.column_stack([columns[f"joint_torque_{i}"] for i in range(6)])
    np.testing.assert_array_equal(torque(JointTorqueSensor(signal="actual_current")), given)
    register = JointTorqueSensor(signal="external_torque", fields=names, sign="on_arm")
    np.testing.assert_array_equal(torque(register)[3], -np.arange(6.0))
    for i in range(6):
        del columns[f"joint_torque_{i}"]
    constants = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    current = JointTorqueSensor(signal="actual_current", torque_constants=constants)
    np.testing.assert_array_equal(torque(current)[0], 2.0 * np.array(constants))
    less = JointTorqueSensor(signal="actual_current_minus_target", torque_constants=constants)
    np.testing.assert_array_equal(torque(less)[0], 1.5 * np.array(constants))


def read_from(columns: dict[str, np.ndarray]) -> ColumnTable:
    return ColumnTable("columns", columns)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c: c.pop("timestamp"), "expected a header line that names the columns"),
        (lambda c: c.pop("actual_qd_3"), "expected the columns actual_qd_0, .*; actual_qd_3 is missing"),
        (
            lambda c: c["actual_q_2"].__setitem__(4, np.nan),
            "actual_q_2: expected finite numbers, got nan in row 5",
        ),
        (lambda c: c["timestamp"].__setitem__(7, 0.0), "timestamp: expected rising times, got 0.0 after"),
        (
            lambda c: [c.pop(f"joint_torque_{i}") for i in range(6)],
            "expected joint_torque_0.. or actual_current_as",
        ),
        (lambda c: [c.pop(f"base_wrench_{i}") for i in range(6)], "expected base_wrench_0..5 .*got none"),
    ],
)
def test_each_defect_is_named(tmp_path: Path, spoil, message: str) -> None:  # type: ignore[no-untyped-def]
    columns = _columns()
    spoil(columns)
    (tmp_path / "a.csv").write_text(_text(columns, ","))
    with pytest.raises(RecordingError, match=message):
        list(samples_of(read(tmp_path / "a.csv"), SCENE))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("timestamp,actual_q_0\n0,a\n1,b\n", "actual_q_0: expected a column of numbers, got string"),
        ("timestamp,x,x\n0,1,2\n1,1,2\n", "x: the column is there twice"),
        ("timestamp,x\n0,1\n", "expected at least two finite times"),
        ("timestamp,x\n0,1\n1,2,3\n", "cannot read the recording: .*Expected 2 columns, got 3"),
        ("", "expected a header line"),
    ],
)
def test_each_broken_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordingError, match=message):
        read(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=r"absent\.csv: cannot read the recording: .*No such file"):
        read(tmp_path / "absent.csv")
    (tmp_path / "a.parquet").write_text("no parquet")
    with pytest.raises(RecordingError, match="cannot read the recording"):
        read(tmp_path / "a.parquet")
