"""What stands beside forces and limits in terminal and reports where they may mislead."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense import Scene, WrenchSensor
from contactsense.sensors.settings import LinkWrenchSensor
from contactsense.service.analysis import analyze as run_analysis
from contactsense.service.analysis.health import health, warning
from contactsense.service.analysis.summary.undetermined_forces import undetermined_forces
from contactsense.service.cli.analyze import analyze
from tests.service.analysis.recordings import demo, write_motion


@pytest.mark.parametrize("last", [500, 2600])
def test_forces_that_no_sensor_determines_are_warned_of(tmp_path: Path, last: int) -> None:
    """Beside the contacts and beside the limits, also where the scene has a sensor that the file lacks."""
    path = write_motion(demo(), tmp_path / "demo.parquet", last=last)
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.drop_columns([f"base_wrench_{i}" for i in range(6)]), path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    limits = tmp_path / "limits.yaml"
    limits.write_text("provenance: us\nregions: [{name: hand, quasi_static: 900, transient: 900}]\n")
    arguments = [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(analyze, [*arguments, "--limits", str(limits)])
    assert result.exit_code == 0, result.output
    warning = "joint torques alone do not determine a force"
    assert warning in result.stdout
    assert "a contact that is above no limit may have been above one" in result.stdout
    for name in ("report.md", "report.html"):
        contacts, under_limits = (tmp_path / "out" / name).read_text().split("Your limits")
        assert contacts.count(warning) == under_limits.count(warning) == 1
        assert "A contact that is above no limit may have been above one." in under_limits
    result = CliRunner().invoke(analyze, [*arguments, "--json"])
    assert warning in json.loads(result.stdout)[0]["undetermined_forces"]


def test_no_force_is_doubted_where_a_sensor_measures_it(folder: Path) -> None:
    assert json.loads((folder / "result.json").read_text())[0]["undetermined_forces"] == ""
    for name in ("report.md", "report.html"):
        assert "do not determine a force" not in (folder / "out" / name).read_text()


def test_forces_of_a_contact_in_which_a_sensor_was_silent_are_doubted(tmp_path: Path) -> None:
    """The impulse is that of the first half of the first contact; what comes later is not known."""
    motion = demo()
    wrench = motion.base_wrench.copy()
    wrench[1800:2110] = np.nan
    path = write_motion(replace(motion, base_wrench=wrench), tmp_path / "run.parquet", last=3200)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    (tmp_path / "limits.yaml").write_text(
        "provenance: us\nregions: [{name: hand, quasi_static: 900, transient: 900}]\n"
    )
    options = ["--scene", str(tmp_path / "scene.yaml"), "--limits", str(tmp_path / "limits.yaml")]
    out = tmp_path / "out"
    result = CliRunner().invoke(analyze, [str(path), *options, "--out", str(out)])
    assert "a contact that is above no limit may have been above one" in result.output
    said = "A sensor was silent or settled during contact 1 (at 3.012 s, for 0."
    assert said in result.output
    assert said in (out / "report.md").read_text()
    assert said in (out / "report.html").read_text()
    silent = pa_parquet.read_table(out / "contacts.parquet")["silent"].to_pylist()
    assert silent[0] == pytest.approx(0.59, abs=0.05)
    assert silent[1] == 0.0


def test_links_beyond_a_sensor_in_the_arm_are_determined() -> None:
    sensor = LinkWrenchSensor(name="elbow", link="forearm")
    scene = Scene(robot="ur5e", base_wrench=None, link_wrenches=(sensor,))
    text = undetermined_forces(scene)
    assert "measures pushes on base, shoulder, upper_arm, and" in text
    assert "as on base and shoulder, may not be listed" in text
    alone = undetermined_forces(scene.model_copy(update={"joint_torque": None}))
    assert alone == "No sensor measures pushes on base, shoulder, upper_arm: they are not listed."
    beyond = scene.model_copy(update={"touchable": ("forearm", "wrist_1")})
    assert undetermined_forces(beyond) == ""
    above = scene.model_copy(update={"touchable": ("upper_arm", "forearm")})
    assert "little may not be listed" in undetermined_forces(above)


def test_a_delay_that_the_scene_does_not_state_is_warned_of(tmp_path: Path) -> None:
    """Two clocks that differ by 10 ms turned the contacts before and after a movement into one."""
    path = write_motion(demo(), tmp_path / "demo.parquet")
    table, late = pa_parquet.read_table(path), 5
    for i in range(6):
        name = f"base_wrench_{i}"
        values = table[name].to_numpy()
        delayed = np.concatenate((np.repeat(values[:1], late), values[:-late]))
        table = table.set_column(table.column_names.index(name), name, pa.array(delayed))
    pa_parquet.write_table(table, tmp_path / "late.parquet")
    assert warning(run_analysis(path, Scene(robot="ur5e"))) == ""
    found = run_analysis(tmp_path / "late.parquet", Scene(robot="ur5e"))
    assert "% of the samples sensors contradicted each other or had more noise than stated" in warning(found)
    right = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=late * 0.002))
    assert warning(run_analysis(tmp_path / "late.parquet", right)) == ""


@pytest.mark.parametrize(("moment", "shown"), [((60.0, -40.0, 50.0), True), ((0.0, 0.0, 0.0), False)])
def test_a_load_that_no_contact_explains_is_reported(
    tmp_path: Path, moment: tuple[float, ...], shown: bool
) -> None:
    motion = demo()
    wrench = motion.base_wrench.copy()
    # Once the arm has been free for a while, so that the beginning does not give it away.
    wrench[1000:1400, 3:] += moment
    path = write_motion(replace(motion, base_wrench=wrench), tmp_path / "load.parquet", last=1400)
    lines = [text for well, text in health(run_analysis(path, Scene(robot="ur5e"))) if not well]
    assert any("or a payload that the scene does not have" in text for text in lines) == shown


def test_limits_in_each_others_place_are_warned_of(folder: Path, tmp_path: Path) -> None:
    write_motion(demo(), tmp_path / "a.parquet", last=500)
    limits = tmp_path / "limits.yaml"
    limits.write_text(
        "provenance: us\nregions:\n- {name: hand, quasi_static: 100, transient: 50}\n"
        "- {name: arm, quasi_static: 100, transient: 100}\n"
    )
    arguments = [str(tmp_path / "a.parquet"), "--scene", str(folder / "scene.yaml"), "--limits", str(limits)]
    result = CliRunner().invoke(analyze, [*arguments, "--out", str(tmp_path)])
    warning = "Limits of hand: the transient one, 50 N, is below the quasi-static one, 100 N"
    assert f"warning: {warning}" in result.stdout
    texts = [result.stdout, *((tmp_path / name).read_text() for name in ("report.md", "report.html"))]
    for text in texts:
        assert text.count(warning) == 1
        assert "Limits of arm" not in text
    result = CliRunner().invoke(analyze, [*arguments, "--out", str(tmp_path), "--json"])
    (told,) = json.loads(result.stdout)[0]["limits"]["warnings"]
    assert told.startswith(warning)
