"""Recordings as calibration takes them: raw readings, no sample with a missing number, clock resets apart."""

from pathlib import Path

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.service.recordings import MappingError, RecordingError
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.free_motion import read_free_motion

N = 20
SCENE = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(
        rpy=(0.1, 0.2, 0.3),
        translation=(0.0, 0.0, -0.05),
        sign="sensor_on_arm",
        bias=(1, 2, 3, 4, 5, 6),
        delay=0.004,
    ),
)


def columns() -> dict[str, np.ndarray]:
    chance = np.random.default_rng(1)
    found = {"timestamp": np.arange(N) * 0.002 + 100.0}
    for group in ("actual_q", "actual_qd", "joint_torque", "base_wrench"):
        found |= {f"{group}_{i}": chance.standard_normal(N) for i in range(6)}
    return found


def group(found: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.column_stack([found[f"{name}_{i}"] for i in range(6)])


def test_readings_are_as_the_sensor_gave_them(tmp_path: Path) -> None:
    made = columns()
    write_columns(tmp_path / "a.parquet", made)
    (found,), problems = read_free_motion(tmp_path / "a.parquet", SCENE)
    assert problems == ()
    assert found.reading is not None
    assert found.torque is not None
    # Neither frame, sign, bias nor delay of the scene are applied: calibration estimates them.
    np.testing.assert_allclose(found.reading, group(made, "base_wrench"), atol=1e-12)
    np.testing.assert_array_equal(found.torque, group(made, "joint_torque"))
    np.testing.assert_array_equal(found.q, group(made, "actual_q"))
    np.testing.assert_array_equal(found.qd, group(made, "actual_qd"))
    np.testing.assert_array_equal(found.t, made["timestamp"])


def test_samples_with_a_missing_number_are_left_out(tmp_path: Path) -> None:
    made = columns()
    made["base_wrench_2"][3] = np.nan
    made["actual_q_0"][7] = np.inf
    write_columns(tmp_path / "a.parquet", made)
    (found,), problems = read_free_motion(tmp_path / "a.parquet", SCENE)
    assert len(found.t) == N - 2
    assert (found.row_of(2), found.row_of(3), found.row_of(-1)) == (2, 4, N - 1)
    assert {problem.row_from for problem in problems} == {3, 7}


def test_where_a_sensor_is_missing_for_long_the_others_are_used(tmp_path: Path) -> None:
    """A sensor that was switched on late cost the torques of all rows before."""
    made = columns()
    made["base_wrench_2"][:10] = np.nan
    made["base_wrench_4"][15] = np.nan
    made["actual_q_0"][9] = np.nan
    made = {name: np.repeat(values, 20) for name, values in made.items()}
    made["timestamp"] = 0.02 * np.arange(20 * N)
    write_columns(tmp_path / "a.parquet", made)
    (late, whole), _ = read_free_motion(tmp_path / "a.parquet", SCENE)
    assert (whole.row_of(0), whole.row_of(-1), len(whole.t)) == (200, 399, 180)
    assert whole.reading is not None
    assert (late.row_of(0), late.row_of(-1), len(late.t)) == (0, 179, 180)
    assert late.reading is None
    assert late.torque is not None
    np.testing.assert_array_equal(late.torque, group(made, "joint_torque")[:180])


def test_a_reset_of_the_clock_begins_a_new_stretch(tmp_path: Path) -> None:
    made = columns()
    made["timestamp"][12:] -= 50.0
    write_columns(tmp_path / "a.parquet", made)
    found, problems = read_free_motion(tmp_path / "a.parquet", SCENE)
    assert [len(stretch.t) for stretch in found] == [12, 8]
    assert [problem.kind for problem in problems] == ["clock_set_back"]


def test_a_sensor_that_the_file_lacks_is_left_out(tmp_path: Path) -> None:
    made = {name: values for name, values in columns().items() if not name.startswith("base")}
    write_columns(tmp_path / "a.csv", made)
    (found,), problems = read_free_motion(tmp_path / "a.csv", SCENE)
    assert found.reading is None
    assert "base_wrench is not used" in problems[0].message


def test_the_scene_names_the_torques(tmp_path: Path) -> None:
    made = columns() | {f"output_double_register_{24 + i}": np.full(N, float(i)) for i in range(6)}
    write_columns(tmp_path / "a.csv", made)
    names = tuple(f"output_double_register_{24 + i}" for i in range(6))
    sensor = JointTorqueSensor(signal="external_torque", fields=names, sign="on_arm")
    (found,), _ = read_free_motion(
        tmp_path / "a.csv", Scene(robot="ur10e", base_wrench=None, joint_torque=sensor)
    )
    assert found.torque is not None
    np.testing.assert_array_equal(found.torque[3], -np.arange(6.0))


def test_too_few_samples_and_wrong_columns_are_refused(tmp_path: Path) -> None:
    made = columns()
    made["joint_torque_0"][2:] = np.nan
    write_columns(tmp_path / "a.csv", made)
    with pytest.raises(RecordingError, match=r"at least 3 samples .* got 2 of 20 with finite numbers$"):
        read_free_motion(tmp_path / "a.csv", SCENE)
    made = columns()
    made["joint_torque_0"][[i for i in range(N) if i not in (1, 10, 11)]] = np.nan
    made["timestamp"][10:] -= 1.0
    write_columns(tmp_path / "a.csv", made)
    with pytest.raises(RecordingError, match=r"rising times, got 3 of 20 .*; the clock was set back once$"):
        read_free_motion(tmp_path / "a.csv", SCENE)
    with pytest.raises(MappingError):
        read_free_motion(tmp_path / "a.csv", SCENE, "no_such_field=x")


def test_a_sensor_that_is_silent_throughout_is_left_out_and_named(tmp_path: Path) -> None:
    """One joint without torques would cost every row; an analysis leaves such a sensor out, too."""
    made = columns() | {"joint_torque_2": np.full(N, np.nan)}
    write_columns(tmp_path / "a.parquet", made)
    (found,), problems = read_free_motion(tmp_path / "a.parquet", SCENE)
    assert found.torque is None
    assert found.reading is not None
    assert len(found.t) == N
    assert str(problems[-1]) == "joint_torque: no row has all its values: it is not used"


def test_a_recording_in_which_every_sensor_is_silent_is_refused(tmp_path: Path) -> None:
    made = columns() | {"joint_torque_2": np.full(N, np.nan), "base_wrench_5": np.full(N, np.inf)}
    write_columns(tmp_path / "a.parquet", made)
    with pytest.raises(RecordingError, match=r"got 0 of 20 .*; never joint_torque, base_wrench$"):
        read_free_motion(tmp_path / "a.parquet", SCENE)


@pytest.mark.parametrize("order", [np.arange(N)[::-1], np.random.default_rng(0).permutation(N)])
def test_rows_in_no_order_of_time_are_told(tmp_path: Path, order: np.ndarray) -> None:
    """Not that the unit of the time were another."""
    write_columns(tmp_path / "a.csv", {name: values[order] for name, values in columns().items()})
    with pytest.raises(
        RecordingError, match=r"timestamp: expected rows in the order of time, got .* Sort them"
    ):
        read_free_motion(tmp_path / "a.csv", SCENE)


def test_times_in_milliseconds_are_told(tmp_path: Path) -> None:
    """They would leave nothing to fit: no two samples belong together."""
    made = columns()
    made["timestamp"] = 1e3 * made["timestamp"]
    write_columns(tmp_path / "a.csv", made)
    with pytest.raises(
        RecordingError, match=r"timestamp: expected samples at most 0.05 s apart, got 2 s; is"
    ):
        read_free_motion(tmp_path / "a.csv", SCENE)
    (found,), _ = read_free_motion(tmp_path / "a.csv", SCENE, "time_unit=ms")
    assert found.t[1] - found.t[0] == pytest.approx(0.002)
