"""Arms from URDFs of one's own: against the library, which reads the same files with code of its own."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result

from contactsense import robots
from contactsense.benchmarks.truth import simulation, urdf_arm
from contactsense.benchmarks.truth.command import main
from contactsense.robots.link_poses import link_poses
from contactsense.robots.urdf.read_urdf import read_chain
from contactsense.service.cli.main import cli

INERTIAL = (
    '<inertial><origin xyz="0.01 0.02 0.1" rpy="0.1 0 0.2"/><mass value="{mass}"/>'
    '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="-0.001" izz="0.025"/></inertial>'
)
URDF = f"""<robot name="odd">
  <link name="world"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="foot"/><origin xyz="0 0 0.1"/></joint>
  <link name="foot">
    {INERTIAL.format(mass=2)}
    <visual><origin xyz="0 0 0.05"/><geometry><box size="0.2 0.2 0.3"/></geometry></visual>
  </link>
  <joint name="waist" type="continuous">
    <parent link="foot"/><child link="trunk"/><origin xyz="0 0 0.2" rpy="0 0.3 0"/><axis xyz="0 0 -1"/>
    <limit effort="50" velocity="2"/>
  </joint>
  <link name="trunk">
    {INERTIAL.format(mass=3)}
    <visual><origin xyz="0 0 0.2" rpy="0 0 1"/>
      <geometry><cylinder radius="0.06" length="0.5"/></geometry></visual>
  </link>
  <joint name="shelf" type="fixed">
    <parent link="trunk"/><child link="plate"/><origin xyz="0 0.1 0.45" rpy="0.2 0 0"/>
  </joint>
  <link name="plate">{INERTIAL.format(mass=0.5)}</link>
  <joint name="elbow" type="revolute">
    <parent link="plate"/><child link="lower"/><origin xyz="0.05 0 0" rpy="0 0 0.4"/><axis xyz="0 2 0"/>
    <limit lower="-2" upper="1.5" effort="40" velocity="3"/>
  </joint>
  <link name="lower">
    {INERTIAL.format(mass=1)}
    <visual><origin xyz="0 0 0.15"/>
      <geometry><mesh filename="package://odd_parts/tube.stl" scale="0.001 0.001 0.001"/></geometry></visual>
  </link>
  <joint name="jaw" type="prismatic">
    <parent link="lower"/><child link="finger"/><origin xyz="0 0 0.3"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.05" effort="10" velocity="0.1"/>
  </joint>
  <link name="finger">
    {INERTIAL.format(mass=0.1)}
    <visual><geometry><sphere radius="0.02"/></geometry></visual>
  </link>
  <joint name="other_jaw" type="revolute">
    <parent link="lower"/><child link="thumb"/><origin xyz="0.03 0 0.3"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="10" velocity="0.1"/><mimic joint="jaw"/>
  </joint>
  <link name="thumb">{INERTIAL.format(mass=0.1)}</link>
</robot>
"""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    parts = tmp_path / "odd_parts"
    (parts / "urdf").mkdir(parents=True)
    trimesh.creation.cylinder(radius=40.0, height=300.0).export(parts / "tube.stl")
    path = parts / "urdf" / "odd.urdf"
    path.write_text(URDF)
    return path


def make(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["make", *arguments])


def test_frames_and_inertia_are_those_of_the_library(urdf: Path) -> None:
    arm, robot = urdf_arm.read(urdf), robots.load(urdf)
    assert arm.name == "odd"
    assert [link.name for link in arm.links] == ["world", "trunk", "lower"]
    for link, known in zip(arm.links, robot.links, strict=True):
        assert link.mass == pytest.approx(known.inertia.mass, rel=1e-12)
        np.testing.assert_allclose(link.com, known.inertia.com, atol=1e-12)
        np.testing.assert_allclose(link.tensor, known.inertia.tensor, atol=1e-12)
    np.testing.assert_allclose(arm.limits, [[-np.pi, -2.0], [np.pi, 1.5]], atol=1e-8)
    np.testing.assert_allclose(arm.speeds, [2.0, 3.0])
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 2))
    origin, rotation = simulation.poses(simulation.dynamics(arm), q)
    expected = link_poses(robot, q)
    np.testing.assert_allclose(origin, expected[:, :, :3, 3], atol=1e-12)
    np.testing.assert_allclose(rotation, expected[:, :, :3, :3], atol=1e-12)


def test_the_surface_is_that_of_the_library(urdf: Path) -> None:
    """Solids and meshes, of links and of what is fixed to them: the same area and the same extent."""
    known = read_chain(urdf).meshes()
    for link in urdf_arm.read(urdf).links:
        mesh = trimesh.Trimesh(link.vertices, link.faces, process=False)
        assert mesh.area == pytest.approx(known[link.name].area, rel=0.02)
        np.testing.assert_allclose(mesh.bounds, known[link.name].bounds, atol=1e-3)


def test_a_package_may_have_another_name_here_as_for_the_library(urdf: Path) -> None:
    renamed = urdf.parents[1].rename(urdf.parents[2] / "clone") / "urdf" / urdf.name
    known = read_chain(renamed).meshes()["lower"]
    link = urdf_arm.read(renamed).links[2]
    assert trimesh.Trimesh(link.vertices, link.faces).area == pytest.approx(known.area, rel=0.02)


def test_a_mirrored_mesh_has_its_outside_outside(urdf: Path) -> None:
    def volume() -> float:
        link = urdf_arm.read(urdf).links[2]
        return float(trimesh.Trimesh(link.vertices, link.faces).volume)

    plain = volume()
    urdf.write_text(URDF.replace('scale="0.001 0.001 0.001"', 'scale="0.001 -0.001 0.001"'))
    assert plain > 0.0
    assert volume() == pytest.approx(plain)


def test_the_tip_ends_the_arm(urdf: Path) -> None:
    arm = urdf_arm.read(urdf, tip="trunk")
    assert [link.name for link in arm.links] == ["world", "trunk"]
    assert arm.mass == pytest.approx(urdf_arm.read(urdf).mass)


@pytest.mark.parametrize(
    ("text", "changed", "message"),
    [
        ("</robot>", "", "expected a URDF, got a document that cannot be parsed: "),
        ('<limit effort="50" velocity="2"/>', "", "joint waist: expected a limit, found none"),
        ('velocity="3"', "", "joint elbow: limit: velocity: expected a number, got none"),
        ('lower="-2"', "", "joint elbow: limit: lower: expected a number, got none"),
        (
            'lower="-2"',
            'lower="2"',
            "joint elbow: limit: expected lower below upper and velocity above zero",
        ),
        ("0 2 0", "0 0 0", "joint elbow: expected an axis, got 0 0 0"),
        ("0 2 0", "0 2", "joint elbow: axis: xyz: expected 3 numbers, got '0 2'"),
        ("0.05 0 0", "0.05 nan 0", "joint elbow: origin: xyz: expected 3 numbers, got '0.05 nan 0'"),
        ("0 0.1 0.45", "0 0.1", "joint shelf: origin: xyz: expected 3 numbers, got '0 0.1'"),
        ('mass value="1"', 'mass value="one"', "link lower: mass: value: expected a number, got 'one'"),
        ('ixx="0.02"', "", "link foot: inertia: ixx: expected a number, got none"),
        (
            'ixx="0.02"',
            'ixx="-2"',
            "link trunk: expected a mass and principal moments above zero, as it moves",
        ),
        ('scale="0.001 0.001 0.001"', 'scale="0.001"', "link lower: mesh: scale: expected 3 numbers"),
        ("odd_parts/tube.stl", "odd_parts/rod.stl", "rod.stl: expected this file below a folder above"),
        ("sphere", "ball", "geometry ball: expected mesh, box, cylinder or sphere"),
        ('<parent link="foot"/>', '<parent link="lower"/>', "expected a tree of links, got a loop"),
        ('<child link="plate"/>', '<child link="dish"/>', "joint shelf: there is no link 'dish'"),
    ],
)
def test_what_cannot_be_used_is_named(urdf: Path, text: str, changed: str, message: str) -> None:
    urdf.write_text(URDF.replace(text, changed))
    with pytest.raises(ValueError, match=rf"^{re.escape(str(urdf))}: .*{message}"):
        urdf_arm.read(urdf)


def test_moving_links_have_a_mass_and_an_arm_has_joints(urdf: Path) -> None:
    urdf.write_text(URDF.replace(INERTIAL.format(mass=3), "").replace(INERTIAL.format(mass=0.5), ""))
    with pytest.raises(ValueError, match="link trunk: expected a mass and principal moments above zero"):
        urdf_arm.read(urdf)
    urdf.write_text(URDF.replace('"revolute"', '"fixed"').replace('"continuous"', '"fixed"'))
    with pytest.raises(ValueError, match="expected an arm with revolute joints, found none"):
        urdf_arm.read(urdf)


def test_links_without_shapes_are_not_touched(urdf: Path, tmp_path: Path) -> None:
    """A base without mass and shape, as in many URDFs; an arm without any shape has no surface."""
    shapes = re.compile(r"<visual>.*?</visual>", re.DOTALL)
    bare = shapes.sub("", URDF, count=1).replace(INERTIAL.format(mass=2), "")
    urdf.write_text(bare)
    truth = tmp_path / "truth"
    done = make("--urdf", str(urdf), "--into", str(truth), "--contacts", "3", "--runs", "1")
    assert done.exit_code == 0, done.output
    assert sorted(path.stem for path in (truth / "meshes" / "odd").iterdir()) == ["lower", "trunk"]
    assert (np.load(truth / "static_points_odd.npz")["link"] > 0).all()
    urdf.write_text(shapes.sub("", URDF))
    with pytest.raises(ValueError, match="expected links with visual shapes, found none"):
        urdf_arm.read(urdf)


def test_errors_of_the_command_are_one_line(urdf: Path, tmp_path: Path) -> None:
    done = make("--urdf", str(urdf), "--tip", "nose", "--into", str(tmp_path / "truth"))
    assert done.exit_code == 1
    assert done.output == (
        f"Error: {urdf}: there is no link 'nose'; links are world, foot, trunk, plate, lower, finger, thumb\n"
    )
    done = make("--tip", "trunk", "--into", str(tmp_path / "truth"))
    assert done.exit_code == 2
    assert "--tip: expected one --urdf, got 0" in done.output


def test_ground_truth_of_other_joints_is_named(urdf: Path, tmp_path: Path) -> None:
    truth = tmp_path / "truth"
    suite = ("--suite", "static", "--contacts", "1")
    done = make("--urdf", str(urdf), "--tip", "trunk", "--into", str(truth), *suite)
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["bench", "truth", str(truth), "--robot", str(urdf)])
    assert done.exit_code == 1
    assert done.output == (
        f"Error: {urdf}: expected ground truth of 2 joints, as the arm has, got 1; "
        "name the same --tip for both\n"
    )


@pytest.mark.long
def test_the_localizer_is_judged_on_an_arm_of_ones_own(urdf: Path, tmp_path: Path) -> None:
    """From the URDF alone: its surface by the library, its contacts by MuJoCo."""
    truth = tmp_path / "truth"
    done = make("--urdf", str(urdf), "--into", str(truth), "--suite", "static", "--contacts", "40")
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(
        cli, ["decompose", str(urdf), "--out", str(urdf.with_suffix(".surface.yaml")), "--jobs", "1"]
    )
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["bench", "truth", str(truth), "--robot", str(urdf), "--json"])
    assert done.exit_code == 0, done.output
    without_noise = json.loads(done.stdout)["results"][0]
    assert without_noise["robot"] == "odd"
    # Two of forty may be missed by chance at 99 %.
    assert without_noise["link_right"] >= 0.95
    assert without_noise["error_mm"]["median"] < 1.0
