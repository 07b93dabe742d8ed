"""The report on a dataset draws each kind of arm as it stands, and states each robot's own assumptions."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense import Scene
from contactsense.robots.primitives import Box
from contactsense.robots.surroundings import Body
from contactsense.service.analysis.fleet.drawn_arms import drawn_arms
from contactsense.service.analysis.fleet.report import write_fleet_report
from contactsense.service.analysis.fleet.summary import FleetSummary, RobotSummary, summarize
from contactsense.service.cli.analyze import analyze
from contactsense.service.scene.summary import link_places
from tests.service.analysis.recordings import demo, write_motion

POST = Box(center=(0.0, 0.0, -0.4), half=(0.1, 0.1, 0.4), rounding=0.01)
PEDESTAL = Body(name="post", role="pedestal", primitives=(POST,))
SCENES: dict[str, dict[str, Any]] = {
    "arm01": {},
    "arm02": {"friction": 0.8},
    "arm03": {"mounting": "ceiling"},
    "arm04": {"bodies": (PEDESTAL,)},
    "arm05": {},
}


def fleet(scenes: dict[str, dict[str, Any]]) -> FleetSummary:
    """A dataset without contacts, of one kind of arm in these scenes."""
    robots = tuple(RobotSummary(name, Scene(robot="ur5e", **values)) for name, values in scenes.items())
    return FleetSummary(robots, summarize({}, [], []).contacts, (), 0)


def test_robots_that_look_alike_are_drawn_in_one_picture() -> None:
    arms = drawn_arms(fleet(SCENES))
    assert [[robot.robot for robot in arm.robots] for arm in arms] == [
        ["arm01", "arm02", "arm05"], ["arm03"], ["arm04"]
    ]  # fmt: skip
    assert arms[0].geometry == arms[1].geometry != arms[2].geometry
    np.testing.assert_allclose(arms[1].up, [0.0, 0.0, -1.0], atol=1e-12)


def test_an_assumption_that_not_all_robots_share_names_those_that_do(tmp_path: Path) -> None:
    write_fleet_report(fleet(SCENES), tmp_path)
    for name in ("fleet.html", "fleet.md"):
        text = (tmp_path / name).read_text()
        assert len(re.findall("At most one contact at a time", text)) == 1
        assert "arm02: Contacts push on the surface; friction coefficient 0.8" in text
        assert "arm01, arm03, arm04, arm05: Contacts push on the surface; friction coefficient 0.5" in text
        assert "arm03: Robot ur5e, mounting ceiling" in text


def test_a_short_recording_lasts_longer_than_nothing(tmp_path: Path) -> None:
    robots = (RobotSummary("a", Scene(robot="ur5e"), recordings=1, hours=0.0021),)
    write_fleet_report(FleetSummary(robots, summarize({}, [], []).contacts, (), 0), tmp_path)
    for name in ("fleet.html", "fleet.md"):
        text = (tmp_path / name).read_text()
        assert "0.0021 h" in text
        assert "0 contacts" in text
    assert "| a | 1 | 0.0021 | 0 |" in (tmp_path / "fleet.md").read_text()


def test_friction_that_no_day_tells_is_called_unknown(tmp_path: Path) -> None:
    """As that of an arm at rest: an empty chart had zero at both ends of its axis."""
    known, unknown = [[0.1] * 6] * 2, [[None] * 6] * 2
    robot = RobotSummary(
        *("a", Scene(robot="ur5e"), 2, 1.0), dates=["2026-01-01", "2026-01-02"], base_bias=known,
        joint_bias=known, joint_constant=unknown, coulomb=unknown, viscous=unknown, coulomb_std=unknown,
        viscous_std=unknown,
    )  # fmt: skip
    write_fleet_report(FleetSummary((robot,), summarize({}, [], []).contacts, (), 0), tmp_path)
    page = (tmp_path / "fleet.html").read_text()
    assert "<figure><figcaption>Coulomb friction beyond the scene's, mean of each day: unknown" in page
    assert "Biases of the joint torques, median of each day</figcaption>" in page


@pytest.mark.slow
def test_forces_that_sensors_did_not_determine_are_told(tmp_path: Path) -> None:
    """Robot a measures everything, the base sensor of b is silent for a while, and c has recordings without
    it."""
    for name in "abc":
        (tmp_path / f"robot={name}").mkdir()
        path = write_motion(demo(), tmp_path / f"robot={name}" / "one.parquet", last=4500)
        table = pa_parquet.read_table(path)
        for column in [f"base_wrench_{i}" for i in range(6)]:
            at = table.schema.get_field_index(column)
            values = np.where(table["timestamp"].to_numpy() < 6.0, np.nan, table[column].to_numpy())
            if name == "b":
                table = table.set_column(at, column, pa.array(values))
            if name == "c":
                table = table.drop_columns(column)
        pa_parquet.write_table(table, path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    arguments = [str(tmp_path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    said = json.loads(CliRunner().invoke(analyze, [*arguments, "--json"]).stdout)["undetermined_forces"]
    assert len(said) == 2
    assert said[0].startswith(
        "b: A sensor was silent or settled during 2 contacts (see `silent` in the table):"
    )
    assert said[1].startswith("c, recordings without base_wrench: No force/torque sensor measures pushes,")
    markdown = (tmp_path / "out" / "fleet.md").read_text()
    page = (tmp_path / "out" / "fleet.html").read_text()
    for text in said:
        assert f"**{text}**" in markdown
        assert text.replace("`silent`", "<code>silent</code>") in page


def test_each_heading_of_the_text_stands_alone(tmp_path: Path) -> None:
    write_fleet_report(fleet(SCENES), tmp_path)
    lines = (tmp_path / "fleet.md").read_text().splitlines()
    for i, line in enumerate(lines):
        if line.startswith("#"):
            assert i == 0 or lines[i - 1] == ""
            assert lines[i + 1] == ""


def test_an_arm_without_contacts_is_drawn_bent(tmp_path: Path) -> None:
    write_fleet_report(fleet({"arm01": {}}), tmp_path)
    page = (tmp_path / "fleet.html").read_text()
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', page)
    assert found is not None
    poses = json.loads(found[1])[0]["view"]["poses"]
    straight = link_places(Scene(robot="ur5e"), np.zeros(6))[-1, 2, 3]
    assert poses[-1][2] > 1e3 * straight + 100.0
