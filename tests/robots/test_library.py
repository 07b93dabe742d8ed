"""The robots that come with the package, and what the loader says about files that are wrong."""

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from contactsense import Scene, SceneError, robots
from contactsense.robots import library
from contactsense.robots.errors import SurfaceFileError
from tests.shared import truth

DH = {
    # d1, a2, a3, d4, d5, d6 as the maker publishes them [m].
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur16e": (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
    "ur20": (0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543),
    "ur30": (0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543),
}
GOOD = """
name: two_bars
links:
  - {name: base, mass: 1.0, com: [0, 0, 0], tensor: [1, 0, 0, 1, 0, 1]}
  - {name: bar, mass: 2.0, com: [0.1, 0, 0], rpy: [0, 0, 1.5707963267948966], tensor: [1, 0, 0, 2, 0, 2]}
joints:
  - {name: hinge, xyz: [0, 0, 0.5], rpy: [0, 0, 0], axis: [0, 2, 0], velocity_limit: 180, torque_limit: 5}
"""


def forward(robot: robots.Robot, q: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, place = np.eye(3), np.zeros(3)
    for joint, angle in zip(robot.joints[:link], q, strict=False):
        assert joint.axis.tolist() == [0.0, 0.0, 1.0]
        c, s = np.cos(angle), np.sin(angle)
        place = place + rotation @ joint.translation
        rotation = rotation @ joint.rotation @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return rotation, place


@pytest.mark.parametrize("name", sorted(DH))
def test_flange_is_where_denavit_and_hartenberg_put_it(name: str) -> None:
    robot = robots.load(name)
    d1, a2, a3, d4, d5, d6 = DH[name]
    rows = [(0.0, np.pi / 2, d1), (a2, 0, 0), (a3, 0, 0), (0, np.pi / 2, d4), (0, -np.pi / 2, d5), (0, 0, d6)]
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, size=(20, 6)):
        pose = np.eye(4)
        for (a, alpha, d), angle in zip(rows, q, strict=True):
            ct, st, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
            pose = pose @ [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        rotation, place = forward(robot, q, 6)
        flange = rotation @ robot.flange_translation + place
        np.testing.assert_allclose(flange, pose[:3, 3], atol=1e-8)
        np.testing.assert_allclose(rotation @ robot.flange_rotation, pose[:3, :3], atol=1e-8)


def test_names_and_links() -> None:
    assert robots.names() == tuple(DH)
    assert robots.load("ur5e").link_names == (
        "base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3",
    )  # fmt: skip


@pytest.mark.parametrize(("model", "arm"), [("ur7e", "ur5e"), ("ur12e", "ur10e")])
def test_equivalent_models_are_the_arm(model: str, arm: str) -> None:
    assert model in robots.known_names()
    assert model not in robots.names()
    assert robots.load(model) is robots.load(arm)
    assert Scene(robot=model) == Scene(robot=arm)


@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
def test_agrees_with_the_ground_truth(name: str) -> None:
    data = truth(f"static_points_{name}.npz")
    robot = robots.load(name)
    assert robot.mass == pytest.approx(-data["base_wrench"][0, 2] / 9.81 + data["f"][0, 2] / 9.81, abs=1e-6)
    for i in range(200):
        rotation, place = forward(robot, data["q"][i], data["link"][i])
        np.testing.assert_allclose(rotation @ data["c_link"][i] + place, data["c_base"][i], atol=1e-12)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(
        robots.UnknownRobotError, match=r"'ur7'; there are ur3, ur3e, ur5, .*ur7e, ur10, .*ur30, or"
    ):
        robots.load("ur7")


def test_reads_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "two_bars.yaml"
    path.write_text(GOOD)
    robot = robots.load(path)
    np.testing.assert_allclose(robot.links[1].inertia.tensor, np.diag([2.0, 1.0, 2.0]), atol=1e-12)
    assert robot.joints[0].axis.tolist() == [0.0, 1.0, 0.0]
    assert robot.joints[0].velocity_limit == pytest.approx(np.pi)
    assert robot.joints[0].position_limits == (-np.inf, np.inf)
    path.with_suffix(".surface.yaml").write_text(
        yaml.safe_dump(
            {
                "robot": "two_bars",
                "links": {
                    "bar": {
                        "fine": [{"kind": "capsule", "a": [0, 0, 0], "b": [1, 0, 0], "radius": 0.1}],
                        "coarse": [{"kind": "sphere", "center": [0, 0, 0], "radius": 0.5}],
                    }
                },
            }
        )
    )
    robot = robots.load(path)
    assert [len(link.primitives) for link in robot.links] == [0, 1]
    assert [len(link.coarse) for link in robot.links] == [0, 1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass: 2.0", "mass: -2.0", r"two_bars.yaml: links\[1\].mass: expected a number above 0, got -2.0"),
        ("mass: 2.0", "mass: .nan", r"links\[1\].mass"),
        ("mass: 2.0", "mass: 1e300", r"links\[1\].mass: expected a number of at most 1000000, got 1e\+300"),
        ("[1, 0, 0, 2, 0, 2]", "[1e300, 0, 0, 2, 0, 2]", r"links\[1\].tensor\[0\]: expected a number"),
        ("mass: 2.0", "weight: 2.0", r"links\[1\].mass: expected a value, the field is missing"),
        ("[1, 0, 0, 2, 0, 2]", "[1, 0, 0, 2, 0, 9]", r"links\[1\]\.tensor: expected .*moments 1, 2, 9 kg"),
        ("[1, 0, 0, 2, 0, 2]", "[1, 0, 0, 2, 0]", r"links\[1\].tensor"),
        ("name: bar", "name: base", r"base: the name is given 2 times"),
        ("name: hinge", "name: hinge, position_limits: [10, -10]", r"0\]: .*expected the lower first"),
        ("  - {name: bar",
         "  - {name: more, mass: 1.0, com: [0, 0, 0], tensor: [1, 0, 0, 1, 0, 1]}\n  - {name: bar",
         r"1 joints need one link more, got 3"),
        ("com: [0.1, 0, 0]", "com: [100, 0, 0]", r"links\[1\].com: .* in m, .*mm: \[0.1, 0, 0\]"),
        ("[0, 0, 0.5]", "[0, 0, 500]", r"joints\[0\].xyz: .* in m, .*if these are mm: \[0, 0, 0.5\]"),
        ("[0, 0, 0.5]", "[0, 0, .nan]", r"joints\[0\].xyz\[2\]: expected a finite"),
        ("rpy: [0, 0, 0],", "rpy: [0, 90, 0],", r"joints\[0\].rpy: .* in rad, .*degrees: \[0, 1.571, 0\]"),
        ("axis: [0, 2, 0]", "axis: [0, 0, 0]", r"joints\[0\]: axis: expected a direction"),
        ("axis: [0, 2, 0]", "axis: [0, .inf, 0]", r"joints\[0\].axis.*: expected .*finite.* got inf"),
        ("torque_limit: 5", "torque_limit: 5, rotor_inertia: .inf", r"joints\[0\].rotor_inertia: .*finite"),
        ("torque_limit: 5", "torque_limit: 5, torque_constant: .inf", r"torque_constant: .*finite"),
        ("torque_limit: 5", "torque_limit: 5, rotor_inertia: 1e300",
         r"joints\[0\].rotor_inertia: expected a number of at most 1000000, got 1e\+300"),
        ("torque_limit: 5", "torque_limit: 5, torque_constant: 1e300",
         r"joints\[0\].torque_constant: expected a number of at most 10000, got 1e\+300"),
        ("torque_limit: 5", "torque_limit: .nan", r"joints\[0\].torque_limit: expected a number above 0"),
        ("name: hinge", "name: hinge, position_limits: [.nan, 1]", r"0\]: .*expected the lower first"),
        ("name: two_bars", "name: [", r"two_bars.yaml: not YAML"),
        ("name: two_bars", "name: two_bars\nname: bars", r"two_bars.yaml: name: expected once, got in line"),
    ],
)  # fmt: skip
def test_wrong_files_are_refused_with_place_and_reason(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "two_bars.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(robots.RobotError, match=message):
        robots.load(path)


def test_a_urdf_without_the_packages_that_read_it_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(robots, "urdf", raising=False)
    monkeypatch.setitem(sys.modules, "contactsense.robots.urdf.read_urdf", None)
    with pytest.raises(SceneError, match=r"robot: .*arm.urdf: a URDF needs .*pip install '\.\[geometry\]'"):
        Scene(robot=str(tmp_path / "arm.urdf"))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(robots.RobotError, match=r"nothing.yaml: cannot read the robot: No such file"):
        robots.load(tmp_path / "nothing.yaml")
    (tmp_path / "latin.yaml").write_bytes("name: Käfer".encode("latin-1"))
    with pytest.raises(robots.RobotError, match=r"latin.yaml: cannot read the robot: expected text in UTF-8"):
        robots.load(tmp_path / "latin.yaml")


def test_surface_of_a_link_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "two_bars.yaml"
    path.write_text(GOOD)
    surface = tmp_path / "two_bars.surface.yaml"
    sphere = "[{kind: sphere, center: [0, 0, 0], radius: 1}]"
    surface.write_text(f"robot: two_bars\nlinks: {{elbow: {{fine: {sphere}, coarse: {sphere}}}}}")
    with pytest.raises(SurfaceFileError, match=r"surface.yaml: links.elbow: two_bars has no such link"):
        robots.load(path)
    surface.write_text(
        f"robot: two_bars\nlinks: {{bar: {{fine: {sphere.replace('1}', '-1}')}, coarse: {sphere}}}}}"
    )
    with pytest.raises(SurfaceFileError, match=r"links.bar.fine.0.*radius"):
        robots.load(path)
    surface.write_text(
        f"robot: two_bars\nlinks: {{bar: {{fine: {sphere}, coarse: {sphere.replace('1}', '40}')}}}}}"
    )
    with pytest.raises(robots.RobotError, match=r"links.bar: coarse\[0\]: .* a size of 80 m; are these mm\?"):
        robots.load(path)


def test_every_file_of_the_library_names_its_sources() -> None:
    for path in Path(library.__file__).parent.glob("*.yaml"):
        assert path.read_text().startswith("#"), path
