"""Names, units and meanings of the columns of a recording."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense import JointTorqueSensor, LinkWrenchSensor, Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.service.cli.main import cli
from contactsense.service.recordings import (
    ColumnMapping,
    MappingError,
    RecordingError,
    read,
)
from contactsense.service.recordings.signals.column_mapping import expand, unit_hint
from tests.service.recordings.recorded_tables import (
    SCENE,
    TORQUES,
    N,
    as_parquet,
    columns,
    table,
    text,
)


def test_a_file_without_a_time_that_is_a_number_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text(columns(), "\t").replace(".", ":"))
    with pytest.raises(RecordingError, match=r"got none: rows 0 to 49: expected numbers, got '100:0\d+', '"):
        read(tmp_path / "a.csv", SCENE)


def test_columns_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    whole = pa.table(columns())
    whole = whole.set_column(0, "timestamp", whole["timestamp"].cast(pa.string()))
    pa_parquet.write_table(whole, tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=r"of numbers: timestamp \(text\); --columns timestamp=NAME"):
        read(tmp_path / "a.parquet", SCENE)


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.list_(pa.float64(), 6)])
def test_a_column_of_lists_is_told_as_such(tmp_path: Path, kind: pa.DataType) -> None:
    """Other loggers write the joints as one column of lists, which are numbers to whoever wrote them."""
    whole = pa.table(columns())
    whole = whole.drop_columns([f"actual_q_{i}" for i in range(6)])
    whole = whole.append_column("actual_q", pa.array([[0.0] * 6] * whole.num_rows, kind))
    pa_parquet.write_table(whole, tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=r"no columns of numbers: actual_q \(lists\); .* each value"):
        read(tmp_path / "a.parquet", SCENE)


@pytest.mark.parametrize(
    ("step", "unit"), [(2.0, "ms"), (2e3, "us"), (2e6, "ns"), (0.6, "ms"), (0.4, None), (0.2, None)]
)
def test_the_unit_that_would_be_plausible_is_proposed(step: float, unit: str | None) -> None:
    assert unit_hint(step, 0.15) == (f"; is another unit meant (--columns time_unit={unit})?" if unit else "")


def test_another_torque_signal_of_the_file_is_named(tmp_path: Path) -> None:
    found = {name.replace("joint_torque", "actual_current"): values for name, values in columns().items()}
    path = as_parquet(tmp_path, found)
    advice = "for actual_current, the scene needs `joint_torque: {signal: actual_current}`"
    with pytest.raises(RecordingError) as error:
        read(path, TORQUES)
    assert str(error.value).endswith(advice)
    (problem,) = read(path, SCENE).problems
    assert problem.message.endswith(f"joint torques are not used; {advice}")
    currents = Scene(robot="ur10e", base_wrench=None, joint_torque=JointTorqueSensor(signal="actual_current"))
    assert read(path, currents).joint_torque is not None


def test_a_table_of_force_torque_readings_is_told_from_one_of_samples(tmp_path: Path) -> None:
    """`recordings/*.parquet` names both of `contactsense record`."""
    wrench = {name: values for name, values in columns().items() if name.startswith("base_wrench")}
    path = as_parquet(tmp_path, {"tick": np.arange(N), "arrival": np.arange(N, dtype=float), **wrench})
    with pytest.raises(RecordingError, match=r"expected a table of samples, got one of force/torque readi"):
        read(path, SCENE)


def test_currents_under_other_names_are_named_by_the_scene(tmp_path: Path) -> None:
    """As joint torques of `--columns` they would be taken for Nm, a tenth of what they mean."""
    names = [f"strom{i}" for i in range(6)]
    currents = {f"strom{i}": columns()[f"joint_torque_{i}"] for i in range(6)}
    others = {name: values for name, values in columns().items() if not name.startswith("joint_torque")}
    path = as_parquet(tmp_path, others | currents)
    sensor = JointTorqueSensor(signal="actual_current")
    scene = Scene(robot="ur10e", base_wrench=None, joint_torque=sensor)
    advice = "with other names go into joint_torque.fields of the scene"
    with pytest.raises(RecordingError, match=advice):
        read(path, scene)
    (problem,) = read(path, scene, ColumnMapping(joint_torque=tuple(names))).problems
    assert problem.kind == "other_torques"
    assert problem.message.endswith(advice)
    named = scene.model_copy(update={"joint_torque": sensor.model_copy(update={"fields": tuple(names)})})
    found = read(path, named)
    assert not found.problems
    own = Scene(robot="ur10e", base_wrench=None)
    torques = read(path, own, ColumnMapping(joint_torque=tuple(names)))
    assert not torques.problems
    assert found.joint_torque is not None
    assert torques.joint_torque is not None
    constants = [joint.torque_constant for joint in own.robot.joints]
    np.testing.assert_allclose(found.joint_torque, torques.joint_torque * constants)


@pytest.mark.parametrize("group", ["joint_torque", "base_wrench"])
def test_a_sensor_that_lacks_one_column_is_refused_with_its_name(tmp_path: Path, group: str) -> None:
    found = {name: values for name, values in columns().items() if name != f"{group}_3"}
    with pytest.raises(RecordingError, match=f"{group}: expected a column {group}_3, found timestamp"):
        read(as_parquet(tmp_path, found), SCENE)


def test_columns_of_sensors_that_the_scene_does_not_have_are_told(tmp_path: Path) -> None:
    """As where the name of a sensor is misspelled, or the scene of another cell is taken."""
    path = as_parquet(tmp_path, columns())
    named = "base_wrench=base_wrench,wrist_wrench=ft,link_wrenches.forarm=ft2"
    problems = read(path, TORQUES, named).problems
    assert [problem.kind for problem in problems] == ["not_in_scene"] * 3
    fields = ("base_wrench", "wrist_wrench", "link_wrenches.forarm")
    for problem, field in zip(problems, fields, strict=True):
        assert problem.message.startswith(f"--columns names {field}, but the scene has no such sensor")
    base = Scene(robot="ur5e", joint_torque=None)
    (problem,) = read(path, base, "joint_torque=joint_torque").problems
    assert problem.kind == "not_in_scene"


@pytest.mark.parametrize(
    "pairs",
    ["q=a,qd=b,q=c", "link_wrenches.ft=a,link_wrenches.ft=b", "link_wrenches=a,link_wrenches.ft=b"],
)
def test_a_name_that_is_given_twice_is_refused(pairs: str) -> None:
    with pytest.raises(MappingError, match=r"expected (q|link_wrenches\.ft) once, got it twice"):
        ColumnMapping.parse(pairs)


def test_a_recording_of_an_arm_with_more_joints_is_refused(tmp_path: Path) -> None:
    """The first six of seven joints need not be those of the arm."""
    path = as_parquet(tmp_path, columns(actual_q_6=np.zeros(N)))
    with pytest.raises(RecordingError, match=r"q: expected 6 columns, .* of ur5e, found actual_q_6 as well"):
        read(path, SCENE)
    named = ColumnMapping(q=tuple(f"actual_q_{i}" for i in range(6)))
    assert len(read(path, SCENE, named)) == N


@pytest.mark.parametrize("command", ["analyze", "calibrate", "check", "record", "reactions check"])
def test_the_example_of_the_help_names_columns(command: str) -> None:
    """A prefix that ends in an underscore would give columns with two."""
    text = CliRunner().invoke(cli, [*command.split(), "--help"]).output
    example = re.search(r"as\s+(q=\S+)\s+or\s+a\s+YAML", text)
    assert example is not None
    assert expand(ColumnMapping.parse(example[1]).q, 2, ()) == ["joint_0", "joint_1"]


@pytest.mark.parametrize(
    ("names", "count", "available", "found"),
    [
        (["q"], 2, ["q_0", "q_1"], ["q_0", "q_1"]),
        (["a", "b"], 2, [], ["a", "b"]),
        (["q"], 1, ["q_0"], ["q_0"]),
        (["q"], 1, ["q"], ["q"]),
    ],
)
def test_a_prefix_is_numbered_and_a_full_list_is_not(
    names: list[str], count: int, available: list[str], found: list[str]
) -> None:
    """One name for one value may be either."""
    assert expand(names, count, available) == found


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_times_in_every_unit_are_seconds(tmp_path: Path, unit: str, per_second: float) -> None:
    found = columns()
    path = as_parquet(tmp_path, found | {"timestamp": found["timestamp"] * per_second})
    recording = read(path, SCENE, ColumnMapping.parse(f"time_unit={unit}"))
    np.testing.assert_allclose(recording.t, found["timestamp"], rtol=1e-12)
    assert recording.problems == ()


def test_other_names_and_units(tmp_path: Path) -> None:
    found = columns()
    renamed = {"time": found["timestamp"] * 1e3}
    renamed |= {f"pos{i}": np.degrees(found[f"actual_q_{i}"]) for i in range(6)}
    renamed |= {f"v_{i}": np.degrees(found[f"actual_qd_{i}"]) for i in range(6)}
    renamed |= {f"tau_{i}": found[f"joint_torque_{i}"] for i in range(6)}
    path = as_parquet(tmp_path, renamed)
    (tmp_path / "m.yaml").write_text(
        "timestamp: time\ntime_unit: ms\nangle_unit: deg\nq: [pos0, pos1, pos2, pos3, pos4, pos5]\n"
        "qd: v\njoint_torque: tau\n"
    )
    recording = read(path, TORQUES, str(tmp_path / "m.yaml"))
    np.testing.assert_allclose(recording.t, found["timestamp"])
    np.testing.assert_allclose(recording.q, table(found, "actual_q"))
    with pytest.raises(RecordingError, match=r"timestamp: expected a column timestamp, found time, pos0"):
        read(path, TORQUES)
    with pytest.raises(MappingError, match="speed"):
        ColumnMapping.parse("speed=v")
    with pytest.raises(MappingError, match=r"bar: unknown field \(known: angle_unit, .*, timestamp, wrist"):
        ColumnMapping.parse("bar=foo")
    with pytest.raises(MappingError, match="time_unit"):
        ColumnMapping.parse("time_unit=h")
    (tmp_path / "none.yaml").write_text("joint_torque: []\n")
    with pytest.raises(
        MappingError, match="joint_torque: expected a prefix or the names of columns, got none"
    ):
        ColumnMapping.parse(str(tmp_path / "none.yaml"))


def test_sensors_that_the_file_lacks_are_named(tmp_path: Path) -> None:
    found = {name: values for name, values in columns().items() if not name.startswith("base_wrench")}
    recording = read(as_parquet(tmp_path, found), SCENE)
    assert recording.base_wrench is None
    assert [problem.kind for problem in recording.problems] == ["missing_sensor"]
    only_motion = {name: v for name, v in found.items() if not name.startswith("joint_torque")}
    with pytest.raises(RecordingError, match="got neither"):
        read(as_parquet(tmp_path, only_motion), SCENE)


@pytest.mark.parametrize("field", ["base_wrench", "wrist_wrench", "link_wrenches.elbow"])
def test_columns_of_a_sensor_that_are_named_must_be_there(tmp_path: Path, field: str) -> None:
    """Without the sensor the contacts would be others: a typing error must not leave it out."""
    elbow = LinkWrenchSensor(name="elbow", link="forearm")
    tool = Tool(mass=1.0)
    scene = Scene(robot="ur5e", tool=tool, wrist_wrench=WrenchSensor(), link_wrenches=(elbow,))
    path = as_parquet(tmp_path, columns())
    assert read(path, scene).base_wrench is not None
    message = (
        rf"{field}: expected a column ft_0, found timestamp.* one column for each value: {field}: \[A, B\]"
    )
    with pytest.raises(RecordingError, match=message):
        read(path, scene, f"{field}=ft")


def test_currents_become_torques(tmp_path: Path) -> None:
    found = columns()
    currents = {name.replace("joint_torque", "actual_current"): v for name, v in found.items()}
    scene = Scene(
        robot="ur5e",
        base_wrench=None,
        joint_torque=JointTorqueSensor(signal="actual_current", torque_constants=(1, 2, 3, 4, 5, 6)),
    )
    recording = read(as_parquet(tmp_path, currents), scene)
    expected = table(found, "joint_torque") * np.arange(1, 7)
    np.testing.assert_allclose(recording.joint_torque, expected)
