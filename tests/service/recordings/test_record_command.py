"""`contactsense record` against the mock arm, and as a converter."""

import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense import Scene
from contactsense.service.cli import record as command
from contactsense.service.cli.record import record
from contactsense.service.live.scheduling import RECORDER
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from contactsense.service.recordings import read
from contactsense.service.sensors.clients.robot_stream import SensorError, StreamHealth
from tests.service.loopback import own_address
from tests.service.simulated_devices import SimulatedDevices, in_own_process
from tests.service.test_commands import run

SCRIPT = Script.model_validate(
    {
        "robot": "ur5e",
        "noise": {"base_force": 0.25, "base_moment": 0.05, "joint_torque": 1.0},
        "trajectory": {"start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0], "dwell": 3.0},
    }
)


@pytest.fixture(scope="module")
def mock() -> Iterator[tuple[Motion, list[str]]]:
    host = own_address()
    with in_own_process(SimulatedDevices, SCRIPT, host) as devices:
        robot, readings, page = (str(port) for port in devices.ports())
        yield (
            simulate(SCRIPT),
            ["--robot-host", host, "--robot-port", robot, "--ft-host", host, "--ft-port", readings,
             "--ft-http-port", page],
        )  # fmt: skip


@pytest.fixture(autouse=True)
def asked(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """What is asked of the process in which the command runs, here that of the tests."""
    made: list[object] = []
    monkeypatch.setattr(command, "prioritize", made.append)
    monkeypatch.setattr(command, "prefer_low_latency", lambda: made.append("low latency"))
    return made


def test_an_outage_is_in_the_summary() -> None:
    """Where a controller starts anew its clock does, too, and no sample counts as lost."""
    assert command._interruptions(StreamHealth(connections=1)) == ""
    error = "the robot has closed the connection"
    again = StreamHealth(connections=3, error=error)
    assert command._interruptions(again) == f"; the robot had to be connected 3 times ({error})"


@pytest.mark.slow
def test_a_live_recording_begins_without_loading_the_calibration() -> None:
    code = "import sys, contactsense.service.cli.record; print('contactsense.calibration' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.realtime
@pytest.mark.slow
def test_every_sample_is_recorded_raw_and_as_used(tmp_path: Path, mock: tuple[Motion, list[str]]) -> None:
    motion, source = mock
    fields = ["--fields", "actual_current,robot_mode"]
    status, out, err = run("record", *source, "--out", str(tmp_path), "--seconds", "6", *fields)
    assert status == 0, err
    assert ", 0 lost" in out
    (path,) = tmp_path.glob("samples-*.parquet")
    table = pa_parquet.read_table(path)
    assert {"arrival", "base_wrench_age", "actual_current_0", "robot_mode"} <= set(table.column_names)
    recording = read(path)  # with the scene that it carries
    step = np.diff(recording.t)
    np.testing.assert_allclose(step, 0.002, atol=1e-6)
    row = np.round(recording.t * 500.0).astype(int) % len(motion.t)
    np.testing.assert_allclose(recording.q, motion.q[row], atol=1e-9)
    np.testing.assert_allclose(recording.joint_torque, motion.joint_torque[row], atol=1e-9)
    used = np.isfinite(recording.base_wrench).all(axis=1)
    # Half a second passes before the clocks are aligned, on a busy computer more.
    assert used.any()
    assert used[np.argmax(used) :].mean() > 0.8
    assert np.abs(recording.base_wrench[used][:, 2]).mean() == pytest.approx(
        np.abs(motion.base_wrench[:, 2]).mean(), rel=0.05
    )
    (path,) = tmp_path.glob("wrench-*.parquet")
    ticks = pa_parquet.read_table(path).column("tick").to_numpy()
    assert len(ticks) > 2000
    assert np.all(np.diff(ticks) > 0)


def test_sensors_are_read_by_an_urgent_process(
    tmp_path: Path, asked: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Threads that read sensors inherit how the thread is scheduled that starts them."""

    def opened(*_: object) -> None:
        asked.append("sensors")
        raise SensorError("no sensors")

    monkeypatch.setattr(command, "LiveSource", opened)
    hosts = ["--robot-host", "127.0.0.1", "--ft-host", "127.0.0.1"]
    result = CliRunner().invoke(record, [*hosts, "--out", str(tmp_path)])
    assert "no sensors" in result.output
    assert asked == [RECORDER, "low latency", "sensors"]


def test_a_robot_that_is_not_there_is_told_and_nothing_is_left(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        record,
        ["--robot-host", "127.0.0.1", "--robot-port", "1", "--ft-host", "127.0.0.1", "--out",
         str(tmp_path / "x"), "--seconds", "0.5"],
    )  # fmt: skip
    assert result.exit_code == 1
    assert "nothing was recorded" in result.output
    assert not list((tmp_path / "x").glob("*"))


def test_sensors_without_an_option_are_those_of_the_environment(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(
        "{robot: ur5e, base_wrench: null, link_wrenches: [{name: elbow, link: forearm}]}"
    )
    arguments = ["--robot-host", "127.0.0.1", "--robot-port", "1", "--seconds", "0.5"]
    arguments += ["--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "x")]
    result = CliRunner().invoke(record, arguments)
    assert "link_wrenches.elbow: expected either" in result.output
    fields = ",".join(f"output_double_register_{i}" for i in range(6))
    variables = {"CONTACTSENSE_LINK_WRENCHES": f'{{"elbow": {{"fields": "{fields}"}}}}'}
    result = CliRunner().invoke(record, arguments, env=variables)
    assert "nothing was recorded: robot at 127.0.0.1:1" in result.output


def test_without_an_address_it_says_what_is_missing(tmp_path: Path) -> None:
    result = CliRunner().invoke(record, ["--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "expected --robot-host" in result.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--url", "http://127.0.0.1:1", "--robot-host", "192.0.2.1"],
            "--robot-host has no effect with --url",
        ),
        (
            ["--from", "a.csv", "--out", "b.csv", "--ft-host", "192.0.2.1"],
            "--ft-host has no effect with --from",
        ),
        (["--out", "folder", "--columns", "q=x"], "--columns is for --from"),
    ],
)
def test_options_of_another_kind_of_recording_are_refused(arguments: list[str], message: str) -> None:
    result = CliRunner().invoke(record, arguments)
    assert result.exit_code == 2
    assert message in result.output


def test_a_recording_is_converted_and_its_problems_are_named(tmp_path: Path) -> None:
    chance = np.random.default_rng(1)
    columns = {"timestamp": 0.01 * np.arange(30)}
    for group in ("actual_q", "actual_qd", "joint_torque"):
        columns |= {f"{group}_{i}": chance.standard_normal(30) for i in range(6)}
    columns["timestamp"][5] = columns["timestamp"][4]
    pa_parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    (tmp_path / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\n")
    arguments = ["--from", str(tmp_path / "a.parquet"), "--out", str(tmp_path / "a.csv")]
    result = CliRunner().invoke(record, [*arguments, "--scene", str(tmp_path / "scene.yaml")])
    assert result.exit_code == 0, result.output
    assert "row 5: the time of the row before is repeated" in result.output
    scene = Scene.load(tmp_path / "scene.yaml")
    np.testing.assert_allclose(
        read(tmp_path / "a.csv", scene).q, read(tmp_path / "a.parquet", scene).q, atol=1e-12
    )
    result = CliRunner().invoke(record, arguments)
    assert result.exit_code == 1
    assert "carries no scene" in result.output


def test_a_name_that_tells_no_format_is_refused_before_the_recording_is_read(tmp_path: Path) -> None:
    """A long one takes minutes."""
    arguments = ["--from", str(tmp_path / "long.parquet"), "--out", str(tmp_path / "a.tsv")]
    result = CliRunner().invoke(record, arguments)
    assert result.exit_code == 1
    assert "a.tsv: expected a name that ends in .parquet, .csv or .mcap" in result.output


FRAMES = """
robot: ur5e
tool: {mass: 1.0, primitives: [{kind: sphere, center: [0, 0, 0.1], radius: 0.05}]}
base_wrench: {rpy: [0.1, 0.2, 0.3], translation: [0, 0, -0.05], sign: sensor_on_arm, bias: [1, 2, 3, 4, 5, 6], delay: 0.004}
wrist_wrench: {rpy: [0, 0, 1], translation: [0, 0, 0.02], bias: [1, 1, 1, 0, 0, 0]}
link_wrenches: [{name: elbow, link: forearm, rpy: [0.3, 0, 0], sign: sensor_on_arm, delay: 0.006}]
joint_torque: {signal: external_torque, fields: [f0, f1, f2, f3, f4, f5], sign: on_arm, bias: 1.0}
"""  # noqa: E501


def test_a_converted_recording_is_read_by_the_same_scene(tmp_path: Path) -> None:
    """Whatever the frames, signs, biases and delays of its sensors, also when it is converted again."""
    chance = np.random.default_rng(2)
    columns = {"timestamp": 0.002 * np.arange(40)} | {f"f{i}": chance.standard_normal(40) for i in range(6)}
    for group in ("actual_q", "actual_qd", "base_wrench", "wrist_wrench", "elbow_wrench"):
        columns |= {f"{group}_{i}": chance.standard_normal(40) for i in range(6)}
    pa_parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    (tmp_path / "scene.yaml").write_text(FRAMES)
    scene = Scene.load(tmp_path / "scene.yaml")
    original = read(tmp_path / "a.parquet", scene)
    names = ["a.parquet", "b.csv", "c.parquet"]
    for origin, out in pairwise(names):
        arguments = ["--from", str(tmp_path / origin), "--out", str(tmp_path / out)]
        result = CliRunner().invoke(record, [*arguments, "--scene", str(tmp_path / "scene.yaml")])
        assert result.exit_code == 0, result.output
        found = read(tmp_path / out, scene)
        for name, values in original.columns().items():
            np.testing.assert_allclose(found.columns()[name], values, atol=1e-9, err_msg=f"{out}: {name}")
    assert original.joint_torque is not None
    np.testing.assert_allclose(read(tmp_path / "c.parquet").joint_torque, original.joint_torque, atol=1e-9)
