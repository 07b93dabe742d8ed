"""What belongs to an arm's file: its tip, its meshes, its gripper's joints; and tools."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from contactsense import Scene, robots
from contactsense.robots.decomposition import mesh_sources
from contactsense.robots.decomposition.mesh_sources import meshes_of, read_arm, read_tool, skin_grids
from contactsense.robots.decomposition.yaml_export import text, tool_text
from contactsense.robots.errors import SurfaceFileError
from contactsense.robots.primitives import Sphere
from contactsense.robots.urdf.meshes import from_folder
from tests.robots.urdf.test_read_urdf import JOINT, LINK, arm, write

SPHERE = Sphere(center=(0.0, 0.0, 0.1), radius=0.05)


def fingers(mimic: bool) -> str:
    """Two turning fingers of two joints each, beside each other on the plate."""
    made = ""
    for side in ("left", "right"):
        for part, parent in (("knuckle", "plate"), ("tip", f"{side}_knuckle")):
            made += LINK.format(name=f"{side}_{part}", z=0.02, mass=0.05, shape='<sphere radius="0.02"/>')
            joint = JOINT.format(
                name=f"{side}_{part}_joint",
                type="revolute",
                parent=parent,
                child=f"{side}_{part}",
                y=0.1,
                axis="0 1 0",
            )
            follows = '<mimic joint="left_knuckle_joint"/>' if mimic and part == "tip" else ""
            made += joint.replace("</joint>", f"{follows}</joint>")
    return made


@pytest.mark.parametrize("mimic", [False, True])
def test_fingers_are_held_and_named(tmp_path: Path, mimic: bool) -> None:
    robot = robots.load(write(tmp_path, arm(6).replace("</robot>", fingers(mimic) + "</robot>")))
    assert [joint.name for joint in robot.joints] == [f"joint{i + 1}" for i in range(6)]
    joints = {f"{side}_{part}_joint" for side in ("left", "right") for part in ("knuckle", "tip")}
    assert set(robot.held) == joints | {"left_finger", "right_finger"}
    assert robot.links[-1].name == "link6"


def test_two_arms_on_one_body_are_no_gripper(tmp_path: Path) -> None:
    """The chain is not cut where it branches into something longer than itself."""
    second = arm(3).partition('<robot name="seven">')[2]
    for name in ("link", "joint", "mount", "plate", "left", "right"):
        second = second.replace(f'"{name}', f'"other_{name}')
    second = second.replace('<parent link="other_link0"/>', '<parent link="link1"/>')
    base = LINK.format(name="other_link0", z=0.1, mass=3.0, shape='<cylinder radius="0.05" length="0.2"/>')
    assert base in second
    robot = robots.load(write(tmp_path, arm(7).replace("</robot>", second.replace(base, ""))))
    assert [joint.name for joint in robot.joints] == [f"joint{i + 1}" for i in range(7)]
    assert "other_joint1" in robot.held


def test_a_following_joint_is_not_the_arms(tmp_path: Path) -> None:
    follows = JOINT.format(
        name="joint3", type="revolute", parent="link2", child="link3", y=0.2, axis="0.6 0 0.8"
    )
    changed = follows.replace("</joint>", '<mimic joint="joint2"/></joint>')
    with pytest.raises(robots.RobotError, match=r"joint joint3 follows joint2: expected an arm whose"):
        robots.load(write(tmp_path, arm().replace(follows, changed)))


def test_the_tip_is_read_from_the_surface(tmp_path: Path) -> None:
    path = write(tmp_path, arm())
    surface = tmp_path / "arm.surface.yaml"
    level = {"fine": (SPHERE,), "coarse": (SPHERE,)}
    surface.write_text(text("seven", {"link3": level}, (), 1.0, "link3"))
    robot = robots.load(path)
    assert robot.tip == "link3"
    assert len(robot.joints) == 3
    assert robots.from_urdf(path, tip="link3").link_names == robot.link_names
    with pytest.raises(SurfaceFileError, match=r"tip: expected plate, but it was made for link3"):
        robots.from_urdf(path, tip="plate")
    assert set(meshes_of(robot)) == set(robot.link_names)


def test_a_urdf_has_its_own_meshes_whatever_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, arm(2).replace('<robot name="seven">', '<robot name="ur5e">'))
    robot = robots.load(path)
    assert robot.name == "ur5e"
    meshes = meshes_of(robot)
    assert set(meshes) == {"link0", "link1", "link2"}
    # The grids take a minute: here it matters only of which meshes they are made.
    monkeypatch.setattr(mesh_sources, "cached", lambda robot, meshes, folder: (robot, sorted(meshes)))
    given, links = skin_grids(robot)  # type: ignore[misc]
    assert given is robot
    assert links == ["link0", "link1", "link2"]
    bare = robots.Robot("ur5e", robot.links, robot.joints)
    with pytest.raises(robots.RobotError, match="ur5e: no meshes known"):
        meshes_of(bare)
    copy = tmp_path / "ur5e.yaml"
    copy.write_text((Path(robots.__file__).parent / "ur5e.yaml").read_text())
    with pytest.raises(robots.RobotError, match="ur5e: no meshes known"):
        meshes_of(robots.load(copy))
    assert set(meshes_of(robots.load("ur5e"))) == set(robots.load("ur5e").link_names)


def test_a_written_scene_loads_the_arm_of_the_file_and_not_its_namesake(tmp_path: Path) -> None:
    path = write(tmp_path, arm(2).replace('<robot name="seven">', '<robot name="ur5e">'))
    level = {"fine": (SPHERE,), "coarse": (SPHERE,)}
    (tmp_path / "arm.surface.yaml").write_text(text("ur5e", {"link2": level}, (), 1.0, None))
    for robot, joints in ((str(path), 2), ("ur5e", 6)):
        written = Scene(robot=robot).model_dump(mode="json")  # type: ignore[arg-type]
        assert len(Scene.model_validate(written).robot.joints) == joints
    assert written["robot"] == "ur5e"


def test_a_tool_is_a_mesh_or_a_urdf(tmp_path: Path) -> None:
    trimesh.creation.box((100.0, 60.0, 40.0)).export(tmp_path / "box.stl")
    with pytest.raises(robots.RobotError, match=r"box.stl: .* m across: .* use --scale 0.001"):
        read_tool(tmp_path / "box.stl")
    robot, meshes = read_tool(tmp_path / "box.stl", 0.001)
    assert robot.link_names == ("flange", "tool")
    assert meshes["tool"].extents == pytest.approx((0.1, 0.06, 0.04))
    path = write(tmp_path, arm(2).replace('type="revolute"', 'type="fixed"'))
    robot, meshes = read_tool(path)
    assert robot.held == ("left_finger", "right_finger")
    assert robot.links[1].inertia.mass == pytest.approx(3.0 + 2.0 + 1.9 + 0.3 + 0.1)
    assert len(meshes["tool"].split(only_watertight=False)) == 6
    with pytest.raises(robots.RobotError, match=r"arm.urdf: no revolute joint; .* decompose .* --as-tool"):
        robots.load(path)
    with pytest.raises(robots.RobotError, match=r"box.stl: a mesh, not an arm; .* --as-tool"):
        robots.load(tmp_path / "box.stl")
    with pytest.raises(robots.RobotError, match=r"expected a mesh .* got '.txt'"):
        read_tool(tmp_path / "box.txt")


def test_endings_in_capitals_are_those_in_lower_case(tmp_path: Path) -> None:
    """Some programs write names in capitals."""
    path = write(tmp_path, arm(2))
    urdf = path.rename(tmp_path / "ARM.URDF")
    robot = robots.load(urdf)
    own, _ = read_arm(str(urdf), None)
    assert own.link_names == robot.link_names
    assert set(meshes_of(robot)) == {"link0", "link1", "link2"}
    copy = tmp_path / "ARM.YAML"
    copy.write_text((Path(robots.__file__).parent / "ur3.yaml").read_text())
    assert robots.load(copy).mass == pytest.approx(robots.load("ur3").mass)
    with pytest.raises(robots.RobotError, match="ur3: no meshes known"):
        meshes_of(robots.load(copy))
    assert read_tool(urdf)[0].name == "ARM"
    with pytest.raises(robots.RobotError, match=r"BOX.STL: a mesh, not an arm"):
        robots.load(tmp_path / "BOX.STL")


def test_meshes_of_a_folder_may_have_endings_in_capitals(tmp_path: Path) -> None:
    def written(name: str, size: float) -> None:
        trimesh.creation.box((size, size, size)).export(tmp_path / name, file_type="stl")

    written("a.STL", 0.1)
    written("b.Stl", 0.2)
    extents = {name: mesh.extents[0] for name, mesh in from_folder(tmp_path, ("a", "b")).items()}
    assert extents == pytest.approx({"a": 0.1, "b": 0.2})
    written("a.stl", 0.3)
    assert from_folder(tmp_path, ("a",))["a"].extents[0] == pytest.approx(0.3)
    with pytest.raises(robots.RobotError, match="no mesh for link A"):
        from_folder(tmp_path, ("A",))


def test_a_tools_text_is_a_scenes_field(tmp_path: Path) -> None:
    robot, _ = read_tool(write(tmp_path, arm(2).replace('type="revolute"', 'type="fixed"')))
    body = robot.links[1].inertia
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "robot: ur5e\n" + tool_text("gripper", body, (SPHERE,), ("0 0 0 12 0.40 5",), ("A gripper.",))
    )
    tool = Scene.load(scene).tool
    assert tool is not None
    assert (tool.name, tool.primitives) == ("gripper", (SPHERE,))
    assert tool.deviation == "0 0 0 12 0.40 5\n"
    assert tool.mass == pytest.approx(body.mass)
    np.testing.assert_allclose(tool.inertia.tensor, body.tensor, rtol=1e-5)
    bare = tool_text("bare", robots.Inertia(0.0, np.zeros(3), np.zeros((3, 3))), (SPHERE,), (), ())
    assert "mass" not in bare
    assert "deviation" not in bare
