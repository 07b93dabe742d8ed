"""Scenes: from Python, from YAML, and what is said of wrong ones."""

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from contactsense import (
    JointTorqueSensor,
    Localizer,
    Scene,
    SceneError,
    WrenchSensor,
    detectability,
    forward_model,
    robots,
)
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.scene import MAX_LINK_WRENCHES
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.stream_state import MAX_SENSORS
from contactsense.service.recordings.metadata import scene_hash


def test_the_robot_name_suffices() -> None:
    scene = Scene(robot="ur5e")
    assert scene.robot.name == "ur5e"
    np.testing.assert_allclose(scene.gravity_base, [0.0, 0.0, -9.81])


def test_scenes_can_be_compared() -> None:
    scene = Scene(robot="ur5e", mounting="ceiling")
    same = pickle.loads(pickle.dumps(scene))
    assert same == scene
    assert same.robot is not scene.robot
    link = replace(scene.robot.links[3], inertia=replace(scene.robot.links[3].inertia, com=np.ones(3)))
    links = (*scene.robot.links[:3], link, *scene.robot.links[4:])
    assert scene.model_copy(update={"robot": replace(scene.robot, links=links)}) != scene
    assert scene.robot != "ur5e"
    assert "robot=<robot ur5e: 6 joints, 21.7 kg>" in repr(scene)
    assert len(repr(scene)) < 2000


def test_paths_in_a_scene_are_relative_to_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "arms").mkdir()
    (tmp_path / "cell").mkdir()
    library = Path(robots.__file__).parent
    for name in ("ur3e.yaml", "ur3e.surface.yaml"):
        (tmp_path / "arms" / name).write_text((library / name).read_text())
    file = tmp_path / "cell" / "scene.yaml"
    file.write_text("robot: ../arms/ur3e.yaml\nmeshes: meshes\n")
    for folder in (tmp_path / "cell", tmp_path):
        monkeypatch.chdir(folder)
        scene = Scene.load(file.relative_to(folder))
        assert scene.robot.file is not None
        assert scene.robot.file.resolve() == tmp_path / "arms" / "ur3e.yaml"
        assert scene.meshes == tmp_path / "cell" / "meshes"
    file.write_text("robot: ur3e\n")
    assert Scene.load(file).robot == robots.load("ur3e")


def test_the_surface_error_defaults_to_the_measured_one() -> None:
    assert Scene(robot="ur5e").surface_deviation == 0.0005
    assert Scene(robot="ur5e", detail="coarse").surface_deviation == 0.004
    assert Scene(robot="ur5e", surface_error=0.001).surface_deviation == 0.001


def test_a_scene_file_gives_the_same_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        "robot: ur10e\nmounting: ceiling\nfriction: 0.6\n"
        "tool:\n  mass: 1.2\n  com: [0, 0, 0.05]\n"
        "  primitives: [{kind: sphere, center: [0, 0, 0.1], radius: 0.03}]\n"
        "base_wrench: {force_noise: 0.5, moment_noise: 0.1, translation: [0, 0, -0.04]}\n"
        "joint_torque: {signal: actual_current, noise: [2, 2, 1, 0.5, 0.5, 0.5]}\n"
        "touchable: [forearm, tool]\n"
    )
    scene = Scene.load(path)
    assert scene.link_names[-1] == "tool"
    assert scene.joint_torque == JointTorqueSensor(signal="actual_current", noise=(2, 2, 1, 0.5, 0.5, 0.5))
    arm = build_constants(scene)
    np.testing.assert_array_equal(arm.touchable, [False, False, False, True, False, False, False, True])
    assert arm.model.mass[-1] == pytest.approx(scene.robot.links[-1].inertia.mass + 1.2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "^robot: expected a value, the field is missing$"),
        (
            {"robot": "ur5e", "base_wrench": {"force_noise": 1e300}},
            r"^base_wrench.force_noise: expected a number of at most 10000, got 1e\+300$",
        ),
        ({"robot": "ur5e", "inertia_error": 1e200}, "^inertia_error: expected a number of at most 10, got"),
        ({"robot": "ur5e", "friction": -1}, "^friction: expected a number above 0, got -1$"),
        (
            {"robot": "ur5e", "frictoin": 0.5},
            r"^frictoin: unknown field \(did you mean friction\?\), got 0.5$",
        ),
        (
            {"robot": "ur5e", "force_noise": 0.3},
            r"^force_noise: unknown field \(did you mean base_wrench.force_noise or "
            r"wrist_wrench.force_noise\?\), got 0.3$",
        ),
        (
            {"robot": "ur5e", "base_wrench": {"noise": 0.3}},
            r"^base_wrench.noise: unknown field \(did you mean base_wrench.force_noise or joint_torque.noise",
        ),
        (
            {"robot": "ur5e", "mounting": "floor"},
            "^mounting: expected table, ceiling, wall or roll, pitch, yaw in rad, got 'floor'$",
        ),
        (
            {"robot": "ur5e", "joint_torque": {"noise": [1, -2, 1, 1, 1, 1]}},
            r"^joint_torque\.noise\[1\]: .*got -2$",
        ),
        (
            {"robot": "ur5e", "base_wrench": {"range": [1, 2, 3]}},
            r"^base_wrench\.range: expected two numbers, force and moment, or six, .*, got 3$",
        ),
        (
            {"robot": "ur5e", "base_wrench": {"range": 2000}},
            r"^base_wrench\.range: expected two numbers, force and moment, or six, .*, got 2000$",
        ),
    ],
)
def test_wrong_arguments_are_explained_as_in_a_file(fields: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        Scene(**fields)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("field", ["mounting", "base_wrench.rpy", "wrist_wrench.rpy"])
def test_angles_in_degrees_are_refused_with_their_radians(field: str) -> None:
    part, _, below = field.partition(".")
    value = [0, 30, 0]
    fields = {"tool": {"mass": 1.0}, part: {below: value} if below else value}
    with pytest.raises(SceneError, match=rf"^{field}: .*got \[0.0, 30.0, 0.0\]; if .* \[0, 0.5236, 0\]$"):
        Scene(robot="ur5e", **fields)
    value[1] = 6
    Scene(robot="ur5e", **fields)


def test_an_arm_without_a_surface_is_refused() -> None:
    arm = robots.load("ur5e")
    bare = replace(arm, links=tuple(replace(link, primitives=()) for link in arm.links))
    with pytest.raises(
        SceneError, match=r"^robot: expected at least one link with a surface, got none on ur5e"
    ):
        Scene(robot=bare)
    ball = Tool(primitives=(Sphere(center=(0, 0, 0.1), radius=0.05),))
    assert Scene(robot=bare, tool=ball).link_names[-1] == "tool"
    with pytest.raises(SceneError, match=r"^touchable: expected at least one link with a surface"):
        Scene(robot=bare, tool=ball, touchable=("forearm",))


def test_an_arm_with_placeholders_for_its_masses_carries_any_tool() -> None:
    arm = robots.load("ur5e")
    light = tuple(
        replace(link, inertia=replace(link.inertia, mass=1e-3, tensor=1e-6 * np.eye(3))) for link in arm.links
    )
    assert Scene(robot=replace(arm, links=light), tool=Tool(mass=1.0)).tool.mass == 1.0


def test_an_arm_built_in_python_is_not_loaded_again_as_the_library_arm_of_its_name() -> None:
    arm = robots.load("ur10e")
    built = replace(arm, name="ur5e", file=None)
    fields = Scene(robot=built).model_dump(mode="json")
    with pytest.raises(SceneError, match=r"robot: unknown robot 'ur5e \(built in Python\)'"):
        Scene(**fields)
    assert Scene(**Scene(robot=arm).model_dump(mode="json")).robot == arm


def test_a_changed_arm_of_the_library_is_not_loaded_again_as_the_library_has_it() -> None:
    arm = robots.load("ur5e")
    heavy = tuple(
        replace(link, inertia=replace(link.inertia, mass=2.0 * link.inertia.mass)) for link in arm.links
    )
    fewer = tuple(replace(link, primitives=link.primitives[:1], deviation=()) for link in arm.links)
    slow = tuple(replace(joint, velocity_limit=0.5) for joint in arm.joints)
    for changed in ({"links": heavy}, {"links": fewer}, {"joints": slow}):
        scene = Scene(robot=replace(arm, **changed))
        assert scene_hash(scene) != scene_hash(Scene(robot=arm))
        with pytest.raises(SceneError, match=r"robot: unknown robot 'ur5e \(built in Python\)'"):
            Scene(**scene.model_dump(mode="json"))


@pytest.mark.parametrize(
    "call",
    [
        Localizer,
        lambda scene: forward_model(scene, np.zeros(6), "forearm", np.zeros(3), np.zeros(3)),
        lambda scene: detectability(scene, np.zeros(6)),
    ],
)
def test_a_name_is_no_scene(call: Callable[[object], object]) -> None:
    told = "expected a Scene, as in Scene(robot='ur5e') or Scene.load('scene.yaml'), got 'ur5e'"
    with pytest.raises(TypeError, match=re.escape(told)):
        call("ur5e")


def test_a_misspelled_method_is_refused() -> None:
    """It would be another one."""
    expected = r"^method: expected one of joint, torques_first, intrinsic, got 'torque_first'$"
    with pytest.raises(ValueError, match=expected):
        Localizer(Scene(robot="ur5e"), "torque_first")  # type: ignore[arg-type]


def test_an_arm_may_be_a_path(tmp_path: Path) -> None:
    file = robots.load("ur5e").file
    assert file is not None
    copy = tmp_path / "my_arm.yaml"
    copy.write_bytes(file.read_bytes())
    (tmp_path / "my_arm.surface.yaml").write_bytes(file.with_suffix(".surface.yaml").read_bytes())
    assert Scene(robot=copy).robot.links == Scene(robot="ur5e").robot.links


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("robot: ur55", "robot: .*ur55"),
        ("mounting: table", "robot: expected a value, the field is missing"),
        ("robot: ur5e\nfriction: -1", "friction: expected a number above 0, got -1"),
        ("robot: ur5e\nfrictoin: 0.5", "frictoin: unknown field"),
        ("robot: ur5e\nmounting: floor", "mounting"),
        ("robot: ur5e\nroom: 0.01", "room: this field is now named clearance"),
        ("robot: ur5e\ntouchable: []", "^.*touchable: expected at least one link, got none$"),
        ("robot: ur5e\ntouchable: [elbow]", "touchable: expected links of base, shoulder, .*got 'elbow'"),
        ("robot: ur5e\njoint_torque: {noise: [1, 1]}", "joint_torque.noise: expected 6 numbers, got 2"),
        ("robot: ur5e\nbase_wrench: null\njoint_torque: null", "expected at least one of the two sensors"),
        ("robot: ur5e\nwrist_wrench: {}", "expected a tool beyond the wrist sensor"),
        (
            "robot: ur5e\ntool: {name: forearm, primitives: [{kind: sphere, center: [0, 0, 0], radius: 1}]}",
            "tool.name: expected a name that no link has, got 'forearm'",
        ),
        ("robot: ur5e\nbase_wrench: {force_noise: .nan}", "base_wrench.force_noise: .*got nan"),
        ("- ur5e", r"expected fields such as `robot: ur5e`, got \['ur5e'\]"),
        ("", "expected fields such as `robot: ur5e`, got nothing"),
        ("robot: ur5e\nmounting: table\nrobot: ur10e", "robot: expected once, got in line 1 and in line 3"),
        (
            "robot: ur5e\ntool: {mass: 1, com: [0, 0, 60]}",
            r"tool.com: expected x, y, z in m, none above 5, got .*; if these are mm: \[0, 0, 0.06\]",
        ),
        (
            "robot: ur5e\ntool: {mass: 1, primitives: [{kind: sphere, center: [0, 0, 0], radius: 60}]}",
            r"tool.primitives\[0\]: expected at most 5 m .* in size, got a size of 120 m; are these mm\?",
        ),
        (
            "robot: ur5e\nbodies: [{name: plate, role: pedestal, primitives: "
            "[{kind: box, center: [0, 0, -10], half: [100, 100, 10], rounding: 3}]}]",
            r"bodies\[0\].primitives\[0\]: expected at most 5 m .* got a size of 200 m; are these mm\?",
        ),
        (
            "robot: ur5e\nbodies: [{name: table, primitives: "
            "[{kind: box, center: [0, 0, -500], half: [400, 300, 100], rounding: 10}]}]",
            r"bodies\[0\].primitives\[0\]: expected at most 50 m .* got a size of 800 m; are these mm\?",
        ),
        (
            "robot: ur5e\nbodies: [{name: hood, role: cover, primitives: "
            "[{kind: box, center: [0, 0, 900], half: [400, 300, 1.5], rounding: 1}]}]",
            r"bodies\[0\].primitives\[0\]: expected at most 50 m .* a distance of 898.5 m; are these mm\?",
        ),
        (
            "robot: ur5e\nbase_wrench: {translation: [0, 0, -35]}",
            "base_wrench.translation: expected x, y, z in m",
        ),
        ("robot: 5", "robot: expected a name that `contactsense robots` lists, .*got 5"),
        ("robot: ur5e\n1: 2", "expected names of fields"),
        (
            "robot: ur5e\nbase_wrench: {delay: 8}",
            "base_wrench.delay: expected s, none above 0.5, got 8; if this is ms: 0.008",
        ),
        (
            "robot: ur5e\ntool: {mass: 1200}",
            r"tool.mass: expected kg, at most the 21.7 kg of the arm itself, got 1200; if this is g: 1.2",
        ),
        (
            "robot: ur5e\ntool: {mass: 1, tensor: [1, 0, 0, 1, 0, 9]}",
            "tool.tensor: expected .*got principal moments 1, 1, 9 kg",
        ),
        ("robot: ur5e\ntool: {mass: 1, tensor: [-1, 0, 0, 1, 0, 1]}", "tool.tensor: expected"),
        (
            "robot: ur5e\ntool: {mass: 1.2, tensor: [2100, 0, 0, 2100, 0, 900]}",
            r"tool.tensor: expected kg m\^2, none above 7.5 for 1.2 kg, got 2100; "
            r"if these are kg mm\^2: \[0.0021, 0, 0, 0.0021, 0, 0.0009\]",
        ),
        (
            "robot: ur5e\nmounting: [0, .nan, 0]",
            r"mounting: expected roll, pitch, yaw in rad, .*, got \[0.0, nan, 0.0\]$",
        ),
        (
            "robot: ur5e\njoint_torque: {signal: external_torque, fields: [a, b, c, d, e, b]}",
            "joint_torque.fields: expected another field for each joint, got 'b' twice",
        ),
        ("robot: ur5e\ngravity: 9810", "gravity: expected a number of at most 30, got 9810"),
        ("robot: ur5e\nclearance: 5", "clearance: expected a number of at most 1, got 5"),
        ("robot: ur5e\nsurface_error: 0.5", "surface_error: expected a number of at most 0.1, got 0.5"),
        ("robot: ur5e\nfriction: 50", "friction: expected a number of at most 10, got 50"),
        (
            "robot: ur5e\nbodies: [{name: table, translation: [600, 0, -20], "
            "primitives: [{kind: sphere, center: [0, 0, 0], radius: 0.1}]}]",
            r"bodies\[0\].translation: expected x, y, z in m, none above 50, got .*; "
            r"if these are mm: \[0.6, 0, -0.02\]",
        ),
        (
            "robot: ur5e\nbodies: [{name: post, tolerance: 10, "
            "primitives: [{kind: box, center: [0, 0, 0], rpy: [0, 0, 90], half: [1, 1, 1], rounding: 0.1}]}]",
            r"bodies\[0\].tolerance: expected a number of at most 1, got 10; .*primitives\[0\].rpy: "
            r"expected roll, pitch, yaw in rad, .*; if these are degrees: \[0, 0, 1.571\]",
        ),
        ("robot: ur5e\ntool: {mass: 1,2}", "tool: expected names of fields, got 2"),
        ("robot: ur5e\ntool: {inertia: 1}", r"did you mean inertia at the outermost level\?"),
        ("robot: [", "not YAML"),
    ],
)
def test_wrong_files_are_explained_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    with pytest.raises(SceneError, match=message) as caught:
        Scene.load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"gone\.yaml: cannot read the scene"):
        Scene.load(tmp_path / "gone.yaml")


def test_a_scene_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        Scene(robot="ur5e").friction = 1.0


def test_a_sensors_own_frame_sign_and_place_are_mapped_to_the_base() -> None:
    """A sensor 40 mm below the base, turned by half a turn about z, that counts the reaction."""
    sensor = WrenchSensor(rpy=(0.0, 0.0, np.pi), translation=(0.0, 0.0, -0.04), sign="sensor_on_arm")
    wrench = np.array([10.0, 2.0, -200.0, 3.0, 4.0, 5.0])
    about_sensor = wrench[3:] - np.cross([0.0, 0.0, -0.04], wrench[:3])
    turn = np.diag([-1.0, -1.0, 1.0])
    reading = -np.concatenate((turn @ wrench[:3], turn @ about_sensor))
    found = WrenchMap.of(sensor)
    np.testing.assert_allclose(found.wrench(reading), wrench, atol=1e-12)
    np.testing.assert_allclose(found.wrench(np.stack([reading] * 3)), np.stack([wrench] * 3), atol=1e-12)
    np.testing.assert_allclose(found.reading(wrench), reading, atol=1e-12)


def test_noise_about_the_sensor_is_carried_to_the_base_origin() -> None:
    """Far below the base, force noise becomes moment noise about the base origin."""
    sensor = WrenchSensor(force_noise=1.0, moment_noise=0.1, translation=(0.0, 0.0, -2.0))
    covariance = build_constants(Scene(robot="ur5e", base_wrench=sensor)).sensors.base_covariance
    np.testing.assert_allclose(np.diag(covariance), [1.0, 1.0, 1.0, 4.01, 4.01, 0.01])
    information = build_constants(Scene(robot="ur5e", base_wrench=sensor)).sensors.base_information
    np.testing.assert_allclose(information @ covariance, np.eye(6), atol=1e-9)


_CALIBRATION = """
kinematics:
  shoulder: {x: 0.0001, y: 0, z: 0.1632, roll: 0, pitch: 0, yaw: 0.001}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.5712, pitch: 0, yaw: 0}
  forearm: {x: -0.4253, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
  wrist_1: {x: -0.3921, y: 0, z: 0.1334, roll: 0, pitch: 0, yaw: 0}
  wrist_2: {x: 0, y: -0.0998, z: 0, roll: 1.5707, pitch: 0, yaw: 0}
  wrist_3: {x: 0, y: 0.0996, z: 0, roll: 1.5708, pitch: 3.1416, yaw: 3.1416}
"""


def test_the_real_arms_calibration_goes_on_top_of_the_model(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(_CALIBRATION)
    scene = Scene(robot="ur5e", kinematics=tmp_path / "mine.yaml")
    np.testing.assert_allclose(scene.robot.joints[0].translation, [0.0001, 0.0, 0.1632])
    assert scene.robot.links[3].primitives == Scene(robot="ur5e").robot.links[3].primitives


def test_a_calibration_that_cannot_be_read_is_named_with_its_field(tmp_path: Path) -> None:
    missing = tmp_path / "mine.yaml"
    with pytest.raises(
        SceneError, match=f"^kinematics: {missing}: cannot read the kinematic calibration: No"
    ):
        Scene(robot="ur5e", kinematics=missing)


def test_another_arms_calibration_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(_CALIBRATION)
    (tmp_path / "scene.yaml").write_text(f"robot: ur10e\nkinematics: {tmp_path / 'mine.yaml'}\n")
    with pytest.raises(SceneError, match=r"another arm's file\?"):
        Scene.load(tmp_path / "scene.yaml")


def test_every_sensor_has_flags_of_its_own() -> None:
    base, torques, wrist = 1, 1, 1
    assert base + torques + wrist + MAX_LINK_WRENCHES == MAX_SENSORS
