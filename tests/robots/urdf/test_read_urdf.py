"""URDFs of any arm, against Pinocchio; and what is said of files that cannot be used."""

from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import trimesh

from contactsense import robots
from contactsense.robots.link_poses import link_poses
from contactsense.robots.urdf.meshes import from_folder
from contactsense.robots.urdf.read_urdf import find_mesh, read_chain

LINK = """
  <link name="{name}">
    <inertial><origin xyz="0.01 0.02 {z}" rpy="0.1 0.2 0.3"/><mass value="{mass}"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial>
    <visual><origin xyz="0 0 0.1" rpy="0.5 0 0"/><geometry>{shape}</geometry></visual>
  </link>"""
JOINT = """
  <joint name="{name}" type="{type}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="0.02 {y} 0.3" rpy="0.4 -0.3 {y}"/><axis xyz="{axis}"/>
    <limit lower="-2" upper="2.5" velocity="3" effort="40"/></joint>"""
AXES = ("0 0 1", "0 1 0", "0.6 0 0.8", "0 0 -1", "1 0 0", "0 0 1", "0 1 0")


def arm(joints: int = 7, **changes: str) -> str:
    """An arm with a gripper: a wrist plate fixed to the last link, two prismatic fingers on it."""
    shape = '<cylinder radius="0.05" length="0.2"/>'
    text = LINK.format(name="link0", z=0.1, mass=3.0, shape=shape)
    for i in range(joints):
        text += LINK.format(name=f"link{i + 1}", z=0.01 * i, mass=2.0 - 0.1 * i, shape=shape)
        text += JOINT.format(
            name=f"joint{i + 1}",
            type="revolute",
            parent=f"link{i}",
            child=f"link{i + 1}",
            y=0.1 * i,
            axis=AXES[i],
        )
    text += LINK.format(name="plate", z=0.0, mass=0.3, shape='<box size="0.1 0.1 0.02"/>')
    text += JOINT.format(
        name="mount", type="fixed", parent=f"link{joints}", child="plate", y=0.3, axis="0 0 1"
    )
    for side in ("left", "right"):
        text += LINK.format(name=side, z=0.02, mass=0.05, shape='<sphere radius="0.02"/>')
        text += JOINT.format(
            name=f"{side}_finger", type="prismatic", parent="plate", child=side, y=0.1, axis="0 1 0"
        )
    for old, new in changes.items():
        text = text.replace(old, new)
    return f'<robot name="seven">{text}</robot>'


def write(folder: Path, text: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text)
    return path


def test_seven_joints_with_a_gripper_as_pinocchio_sees_them(tmp_path: Path) -> None:
    path = write(tmp_path, arm())
    robot = robots.from_urdf(path)
    assert robot.name == "seven"
    assert robot.link_names == tuple(f"link{i}" for i in range(8))
    assert robot.joints[0].position_limits == (-2.0, 2.5)
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    assert robot.mass - robot.links[0].inertia.mass == pytest.approx(
        sum(body.mass for body in model.inertias) - 3.0
    )
    for q in np.random.default_rng(0).uniform(-2, 2, size=(10, 7)):
        pinocchio.framesForwardKinematics(model, data, np.concatenate((q, np.zeros(2))))
        poses = link_poses(robot, q)
        for i in range(8):
            expected = data.oMf[model.getFrameId(f"link{i}")].homogeneous
            np.testing.assert_allclose(poses[i], expected, atol=1e-12)
        # The gripper's mass is joined to the last link.
        com = pinocchio.centerOfMass(model, data, np.concatenate((q, np.zeros(2))))
        bodies = [(link.inertia.mass, pose[:3, :3] @ link.inertia.com + pose[:3, 3])
                  for link, pose in zip(robot.links, poses, strict=True)]  # fmt: skip
        moving = sum(mass * place for mass, place in bodies[1:])
        np.testing.assert_allclose(moving / sum(mass for mass, _ in bodies[1:]), com, atol=1e-12)


def test_inertia_of_joined_links_as_pinocchio_joins_them(tmp_path: Path) -> None:
    path = write(tmp_path, arm())
    last = robots.from_urdf(path).links[-1].inertia
    model = pinocchio.buildModelFromUrdf(str(path))
    frames = [frame for frame in model.frames if frame.name in ("link7", "plate", "left", "right")]
    assert len(frames) == 4
    locked = pinocchio.buildReducedModel(
        model, [model.getJointId("left_finger"), model.getJointId("right_finger")], pinocchio.neutral(model)
    )
    expected = locked.inertias[7]
    assert last.mass == pytest.approx(expected.mass)
    np.testing.assert_allclose(last.com, expected.lever, atol=1e-12)
    np.testing.assert_allclose(last.tensor, expected.inertia, atol=1e-12)


def test_a_tip_ends_the_arm_and_is_its_flange(tmp_path: Path) -> None:
    robot = robots.from_urdf(write(tmp_path, arm()), tip="plate", name="mine")
    assert robot.name == "mine"
    assert robot.flange_translation == pytest.approx((0.02, 0.3, 0.3))
    short = robots.from_urdf(write(tmp_path, arm()), tip="link3")
    assert len(short.joints) == 3
    assert short.mass == pytest.approx(robot.mass)


def test_meshes_are_scaled_placed_and_joined(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((100.0, 200.0, 300.0)).export(tmp_path / "meshes" / "box.stl")
    mesh = '<mesh filename="package://thing/meshes/box.stl" scale="0.001 0.001 0.001"/>'
    text = arm().replace('<cylinder radius="0.05" length="0.2"/>', mesh, 1)
    meshes = read_chain(write(tmp_path, text)).meshes()
    assert sorted(meshes) == [f"link{i}" for i in range(8)]
    assert meshes["link0"].area == pytest.approx(2 * (0.02 + 0.06 + 0.03))
    assert meshes["link0"].bounds.mean(axis=0) == pytest.approx((0.0, 0.0, 0.1), abs=1e-9)
    # Last link, plate and two fingers.
    assert len(meshes["link7"].split(only_watertight=False)) == 4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({'name="joint3" type="revolute"': 'name="joint3" type="floating"'},
         r"joint joint3: expected a revolute, continuous or fixed joint between .*, got floating"),
        ({'name="joint3" type="revolute"': 'name="joint3" type="prismatic"'},
         r"joint joint3: expected a revolute, continuous or fixed joint between .*, got prismatic"),
        ({'type="revolute"': 'type="fixed"'}, r"no revolute joint"),
        ({'<parent link="link2"/>': '<parent link="nowhere"/>'}, r"joint joint3: there is no link nowhere"),
        ({'<parent link="link2"/><child link="link3"/>': '<parent link="link2"/><child link="link2"/>'},
         r"expected one root link"),
        ({'<link name="plate">': '<joint name="loop" type="fixed"><parent link="link4"/><child link="link4"/>'
          '</joint><link name="plate">'},
         r"joint loop: expected two links, got link4 twice"),
        ({'effort="40"': 'effort="40 Nm"'}, r"joint joint1: limit: effort: expected a number, got '40 Nm'"),
        ({'mass value="2.0"': 'mass value="2,0"'}, r"link link1: mass: value: expected a number, got '2,0'"),
        ({'axis xyz="0.6 0 0.8"': 'axis xyz="0 0 0"'}, r"joint joint3: the axis has no direction"),
        ({'axis xyz="0.6 0 0.8"': 'axis xyz="inf 0 0.8"'},
         r"joint joint3: the axis has no direction: \[inf, 0\.0, 0\.8\]"),
        ({'<parent link="link2"/><child link="link3"/>': '<parent link="link2"/>'},
         r"joint joint3: expected the element child, got none"),
        ({'<parent link="link2"/>': ""}, r"joint joint3: expected the element parent, got none"),
        ({'mass value="2.0"': 'mass value="-2.0"'}, r"link link1: mass"),
        ({'lower="-2" upper="2.5"': 'lower="2.5" upper="-2"'},
         r"joint joint1: limits: expected lower <= upper, got 2\.5 and -2 rad"),
        ({'lower="-2" upper="2.5"': 'lower="nan" upper="2.5"'},
         r"joint joint1: limits: expected lower <= upper, got nan and 2\.5 rad"),
        ({'effort="40"': 'effort="-40"'}, r"joint joint1: effort: expected no negative number, got -40"),
        ({'axis xyz="0.6 0 0.8"': 'axis xyz="0.6 0.8"'},
         r"joint joint3: axis: xyz: expected three numbers, got '0\.6 0\.8'"),
        ({'xyz="0.02 0.1 0.3"': 'xyz="20 100 300"'},
         r"joint joint2: origin: xyz: expected x, y, z in m, none above 5, got .*mm: \[0\.02, 0\.1, 0\.3\]"),
        ({'rpy="0.4 -0.3 0.1"': 'rpy="20 -15 5"'},
         r"joint joint2: origin: rpy: expected roll, pitch, yaw in rad, .*if these are degrees: \[0\.3491,"),
        ({'xyz="0.01 0.02 0.02"': 'xyz="10 20 20"'}, r"link link3: origin: xyz: .* above 5, .*mm: \[0\.01"),
        ({'xyz="0.01 0.02 0.02"': 'xyz="nan 0.02 0.02"'}, r"link link3: origin: xyz: expected x, y, z in m"),
        ({'ixx="0.02"': 'ixx="0.2"'}, r"link link0: inertia: expected the .*moments .*, 0\.2 kg"),
        ({'ixx="0.02"': 'ixx="-0.02"'}, r"link link0: inertia: expected the .*moments -0\.02"),
        ({'<link name="link4">': '<link name="link3">'}, r"link link3: the name is given 2 times"),
        ({'<joint name="joint4"': '<joint name="joint3"'}, r"joint joint3: the name is given 2 times"),
        ({'<child link="plate"/>': '<child link="link2"/>'},
         r"link link2: expected one joint that carries it, got joint2, mount"),
        ({'xyz="0.02 0.1 0.3"': 'xyz="0.02 ${y} 0.3"'}, r"expected URDF, got xacro; expand it first: xacro"),
        ({'<link name="link0">': "<link>"}, r"no valid URDF: an element lacks the attribute 'name'"),
        ({'<box size="0.1 0.1 0.02"/>': ""},
         r"link plate: visual: geometry: expected one of box, cylinder, sphere, mesh, got none"),
        ({'<box size="0.1 0.1 0.02"/>': '<capsule radius="0.1" length="0.2"/>'},
         r"link plate: visual: geometry: expected one of box, .*, got capsule"),
        ({'<box size="0.1 0.1 0.02"/>': '<mesh file="box.stl"/>'},
         r"link plate: visual: mesh: expected the attribute filename, got none"),
        ({'lower="-2" upper="2.5"': 'lower="-114.6" upper="143.2"'},
         r"joint joint1: limits: expected rad, .* got -114\.6 and 143\.2; if these are degrees: -2 and"),
        ({'<joint name="mount" type="fixed"': '<joint name="mount" type="screw"'},
         r"joint mount: type: expected one of revolute, .*, got screw"),
        ({'<child link="right"/>': '<child link="right"/><mimic joint="joint7"/>'},
         r"joint right_finger: .* held at zero, but it follows joint7 of the arm"),
        ({'<child link="link3"/>': '<child link="link3"/><mimic joint="joint2"/>'},
         r"joint joint3 follows joint2: expected an arm whose joints move by themselves"),
    ],
)  # fmt: skip
def test_unusable_urdfs_are_refused_with_the_element(
    tmp_path: Path, changes: dict[str, str], message: str
) -> None:
    with pytest.raises(robots.RobotError, match=message):
        robots.from_urdf(write(tmp_path, arm(**changes)))


def test_an_arm_far_from_the_root_and_angles_of_one_turn_are_no_mistake_of_units(tmp_path: Path) -> None:
    text = arm(**{'rpy="0.4 -0.3 0.1"': 'rpy="6.2832 -6.28319 0"'}).replace("<robot name=\"seven\">", (
        '<robot name="seven"><link name="world"><visual><origin xyz="6 0 -6"/><geometry>'
        '<box size="1 1 1"/></geometry></visual></link><joint name="base" type="fixed">'
        '<parent link="world"/><child link="link0"/><origin xyz="0 12 0"/></joint>'
    ))  # fmt: skip
    robot = robots.from_urdf(write(tmp_path, text))
    assert robot.joints[0].translation[1] == pytest.approx(12.0)
    far = text.replace('xyz="0 12 0"', 'xyz="0 1200 0"')
    with pytest.raises(robots.RobotError, match=r"joint base: origin: xyz: .* none above 50, got"):
        robots.from_urdf(write(tmp_path, far))


@pytest.mark.parametrize("kind", ["prismatic", "planar", "floating"])
def test_what_moves_the_base_is_held_at_zero(tmp_path: Path, kind: str) -> None:
    below = LINK.format(name="cart", z=0.1, mass=20.0, shape='<box size="1 1 0.5"/>')
    below += JOINT.format(name="lift", type=kind, parent="cart", child="link0", y=0.1, axis="0 0 1")
    path = write(tmp_path, arm().replace('<robot name="seven">', f'<robot name="seven">{below}'))
    robot = robots.from_urdf(path)
    assert robot.link_names == ("cart", *(f"link{i}" for i in range(1, 8)))
    assert robot.held == ("lift", "left_finger", "right_finger")
    assert robot.links[0].inertia.mass == pytest.approx(23.0)
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    at_zero = pinocchio.neutral(model)
    pinocchio.framesForwardKinematics(model, data, at_zero)
    expected = data.oMf[model.getFrameId("link7")]
    pose = link_poses(robot, np.zeros(7))[7]
    np.testing.assert_allclose(pose[:3, 3], expected.translation, atol=1e-12)


def test_limits_that_stand_for_none_are_accepted(tmp_path: Path) -> None:
    text = arm(**{'lower="-2" upper="2.5"': 'lower="-1e16" upper="1e16"'})
    assert robots.from_urdf(write(tmp_path, text)).joints[0].position_limits == (-1e16, 1e16)
    with pytest.raises(robots.RobotError, match=r"expected links, got none"):
        robots.from_urdf(write(tmp_path, '<robot name="empty"/>'))


LIMIT = '<limit lower="-2" upper="2.5" velocity="3" effort="40"/>'


@pytest.mark.parametrize(
    ("kind", "limit", "found"),
    [
        ("revolute", LIMIT, ((-2.0, 2.5), 3.0, 40.0)),
        ("revolute", '<limit lower="0" upper="0" velocity="0" effort="0"/>', ((0.0, 0.0), np.inf, np.inf)),
        ("revolute", '<limit lower="-1" upper="1"/>', ((-1.0, 1.0), np.inf, np.inf)),
        ("continuous", "", ((-np.inf, np.inf), np.inf, np.inf)),
        ("continuous", LIMIT, ((-np.inf, np.inf), 3.0, 40.0)),
        ("revolute", "", None),
        ("revolute", '<limit lower="-1" velocity="3" effort="40"/>', None),
        ("revolute", '<limit upper="1" velocity="3" effort="40"/>', None),
    ],
)
def test_limits_of_a_joint(
    tmp_path: Path, kind: str, limit: str, found: tuple[tuple[float, float], float, float] | None
) -> None:
    """Without an axis, it turns about x."""
    joint = f'name="joint1" type="{kind}"'
    text = arm(**{'name="joint1" type="revolute"': joint}).replace(LIMIT, limit, 1)
    path = write(tmp_path, text.replace('<axis xyz="0 0 1"/>', "", 1))
    if found is None:
        with pytest.raises(robots.RobotError, match=r"joint joint1: a revolute joint needs lower and upper"):
            robots.from_urdf(path)
        return
    first = robots.from_urdf(path).joints[0]
    assert (first.position_limits, first.velocity_limit, first.torque_limit) == found
    np.testing.assert_array_equal(first.axis, [1.0, 0.0, 0.0])


def test_a_namespace_is_refused(tmp_path: Path) -> None:
    """Its elements would not be found."""
    text = arm().replace("<robot ", '<robot xmlns="http://www.ros.org" ')
    with pytest.raises(robots.RobotError, match=r"URDF without a namespace, got xmlns='http://www.ros.org'"):
        robots.from_urdf(write(tmp_path, text))


def test_the_folder_in_which_a_file_was_looked_for_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(robots.RobotError, match=f"^none.urdf: no such file in {tmp_path}$"):
        robots.from_urdf("none.urdf")


def test_an_arm_with_an_empty_name_has_that_of_its_file(tmp_path: Path) -> None:
    assert robots.from_urdf(write(tmp_path, arm().replace('name="seven"', 'name=""'))).name == "arm"


def test_unusable_files_and_tips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(robots.RobotError, match=r"none.urdf: no such file"):
        robots.from_urdf(tmp_path / "none.urdf")
    with pytest.raises(robots.RobotError, match=r"arm.urdf: no valid URDF"):
        robots.from_urdf(write(tmp_path, "<robot"))
    whole = arm()
    for share in (0.5, 0.7, 0.9, 0.97):
        with pytest.raises(robots.RobotError, match=r"arm.urdf: no valid URDF: .*line \d+, column \d+"):
            robots.from_urdf(write(tmp_path, whole[: int(share * len(whole))]))
    with pytest.raises(robots.RobotError, match=r"expected URDF, got SDF"):
        robots.from_urdf(write(tmp_path, "<sdf><model name='arm'/></sdf>"))
    with pytest.raises(robots.RobotError, match=r"root element robot, got mujoco"):
        robots.from_urdf(write(tmp_path, "<mujoco/>"))
    macro = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>'
    with pytest.raises(robots.RobotError, match=r"got xacro"):
        robots.from_urdf(write(tmp_path, macro))
    with pytest.raises(robots.RobotError, match=r"there is no link hand; links are link0, "):
        robots.from_urdf(write(tmp_path, arm()), tip="hand")


@pytest.mark.parametrize(
    ("shape", "wanted"),
    [
        (
            '<cylinder radius="-0.05" length="0.2"/>',
            "cylinder: expected 2 sizes of at least 0 m, got -0.05 0.2",
        ),
        ('<sphere radius="nan"/>', "sphere: expected a size of at least 0 m, got nan"),
        ('<box size="0.1 0.2"/>', "box: expected 3 sizes of at least 0 m, got 0.1 0.2"),
    ],
)
def test_sizes_that_no_shape_has_are_refused(tmp_path: Path, shape: str, wanted: str) -> None:
    text = arm().replace('<cylinder radius="0.05" length="0.2"/>', shape, 1)
    with pytest.raises(robots.RobotError, match=f"link link0: visual: {wanted}"):
        read_chain(write(tmp_path, text)).meshes()


@pytest.mark.parametrize("scale", ["1 1", "1 0 1", "nan nan nan"])
def test_a_scale_that_no_mesh_has_is_refused(tmp_path: Path, scale: str) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.stl")
    mesh = f'<mesh filename="box.stl" scale="{scale}"/>'
    text = arm().replace('<cylinder radius="0.05" length="0.2"/>', mesh, 1)
    wanted = f"link link0: visual: mesh: scale: expected 3 numbers other than 0, got {scale}"
    with pytest.raises(robots.RobotError, match=wanted):
        read_chain(write(tmp_path, text)).meshes()


def test_a_tip_before_the_first_joint_is_refused(tmp_path: Path) -> None:
    with pytest.raises(robots.RobotError, match=r"tip link0: expected a link behind a revolute joint"):
        read_chain(write(tmp_path, arm()), tip="link0")


def test_unusable_meshes_are_refused(tmp_path: Path) -> None:
    cylinder = '<cylinder radius="0.05" length="0.2"/>'
    text = arm().replace(cylinder, '<mesh filename="box.stl"/>', 1)
    with pytest.raises(robots.RobotError, match=r"arm.urdf: mesh box.stl is missing"):
        read_chain(write(tmp_path, text)).meshes()
    trimesh.creation.box((100.0, 200.0, 300.0)).export(tmp_path / "box.stl")
    with pytest.raises(robots.RobotError, match=r"link link0: \d+ m across: not in metres\?"):
        read_chain(write(tmp_path, text)).meshes()
    trimesh.creation.box((1e-4, 2e-4, 3e-4)).export(tmp_path / "box.stl")
    with pytest.raises(robots.RobotError, match=r"link link0: 0\.000\d+ m across: in metres already\?"):
        read_chain(write(tmp_path, text)).meshes()
    (tmp_path / "box.stl").write_text("solid nothing\nendsolid nothing\n")
    with pytest.raises(robots.RobotError, match=r"box.stl: "):
        read_chain(write(tmp_path, text)).meshes()
    (tmp_path / "box.dae").write_text("<COLLADA><library_geometries>")
    with pytest.raises(robots.RobotError, match=r"box.dae: not readable as a mesh: "):
        read_chain(write(tmp_path, text.replace("box.stl", "box.dae"))).meshes()
    with pytest.raises(robots.RobotError, match=r"no such folder"):
        from_folder(tmp_path / "none", ("link0",))
    with pytest.raises(robots.RobotError, match=r"no mesh for link link0"):
        from_folder(tmp_path, ("link0",))


def test_package_names_are_searched_upwards(tmp_path: Path) -> None:
    folder = tmp_path / "my_package" / "urdf"
    folder.mkdir(parents=True)
    (tmp_path / "my_package" / "box.stl").write_text("")
    assert find_mesh(folder / "arm.urdf", "package://my_package/box.stl").name == "box.stl"
    # The package may have another name here, unless it is there.
    assert find_mesh(folder / "arm.urdf", "package://gripper/box.stl").parent.name == "my_package"
    (tmp_path / "gripper").mkdir()
    (tmp_path / "gripper" / "box.stl").write_text("")
    assert find_mesh(folder / "arm.urdf", "package://gripper/box.stl").parent.name == "gripper"
    with pytest.raises(robots.RobotError, match=r"other/x\.stl is missing: .* folders above the URDF"):
        find_mesh(folder / "arm.urdf", "package://other/x.stl")


def test_panda() -> None:
    """Needs PyPI's example-robot-data (131 MB), which is not among the test packages."""
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed")
    path = next(Path(str(file.locate())) for file in files if file.name == "panda.urdf")
    chain = read_chain(path)
    assert len(chain.robot.joints) == 7
    meshes = chain.meshes()
    assert set(meshes) == set(chain.robot.link_names)


def test_a_prefix_without_a_namespace_is_tolerated_without_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = arm().replace("<limit ", '<limit drake:acceleration="1" ', 1)
    assert (
        robots.from_urdf(write(tmp_path, text)).link_names
        == robots.from_urdf(write(tmp_path, arm())).link_names
    )
    assert caplog.text == ""
    with pytest.raises(robots.RobotError, match=r"joint joint2: origin: xyz: expected x, y, z in m"):
        robots.from_urdf(write(tmp_path, text.replace('xyz="0.02 0.1 0.3"', 'xyz="20 100 300"')))
