"""Numbers of a scene that are possible but not those of its arm."""

import dataclasses

import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor, robots
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.scene import SceneError
from contactsense.sensors.settings import Friction, LinkInertia
from contactsense.service.scene.load_warnings import load_warnings, weightless_tool

NONE = (0.0,) * 6
RATED = {"ur3e": 3.0, "ur5e": 5.0, "ur10e": 12.5, "ur16e": 16.0, "ur20": 20.0}
"""Payloads of the arms [kg], from their data sheets."""


def with_tensor(xx: float, yy: float, zz: float) -> Scene:
    tensor = (xx, 0.0, 0.0, yy, 0.0, zz)
    inertia = LinkInertia(mass=2.85, com=(0.0, 0.0, 0.0), tensor=tensor)
    return Scene(robot="ur5e", inertia={"forearm": inertia})


def test_an_arm_of_ones_own_that_is_too_heavy_for_its_joints_is_told() -> None:
    """One of its links has a mass of 3.7 t."""
    arm = robots.load("ur5e")
    upper_arm = arm.links[2]
    heavy = dataclasses.replace(upper_arm.inertia, mass=1000.0 * upper_arm.inertia.mass)
    links = (*arm.links[:2], dataclasses.replace(upper_arm, inertia=heavy), *arm.links[3:])
    assert not list(load_warnings(Scene(robot=dataclasses.replace(arm, file=None))))
    (found,) = load_warnings(Scene(robot=dataclasses.replace(arm, file=None, links=links)))
    assert found.startswith("robot: expected a weight that shoulder_lift_joint can hold (150 Nm), got ")


def test_an_inertia_in_kg_mm2_in_the_file_of_an_arm_is_told() -> None:
    """That of the base, which does not move, is of no effect."""
    arm = robots.load("ur5e")

    def in_mm(index: int) -> robots.Robot:
        links = list(arm.links)
        own = links[index].inertia
        links[index] = dataclasses.replace(
            links[index], inertia=dataclasses.replace(own, tensor=1e6 * own.tensor)
        )
        return dataclasses.replace(arm, file=None, links=tuple(links))

    (found,) = load_warnings(Scene(robot=in_mm(3)))
    assert found.startswith("robot: link forearm: inertia: expected kg m^2, none above 17.79 for 2.846 kg,")
    assert "; if these are kg mm^2: [" in found
    assert not list(load_warnings(Scene(robot=in_mm(0))))
    own = LinkInertia(mass=2.85, com=(0.0, 0.0, 0.0), tensor=(0.1, 0.0, 0.0, 0.1, 0.0, 0.1))
    assert not any(
        "link forearm" in text for text in load_warnings(Scene(robot=in_mm(3), inertia={"forearm": own}))
    )


def test_a_tool_with_a_surface_weighs_something() -> None:
    shapes = (Sphere(center=(0.0, 0.0, 0.1), radius=0.03),)
    (found,) = weightless_tool(Scene(robot="ur5e", tool=Tool(primitives=shapes)))
    assert found == "tool.mass: expected the mass of a tool that has a surface, got 0 kg"
    assert not list(weightless_tool(Scene(robot="ur5e", tool=Tool(mass=0.1, primitives=shapes))))
    assert not list(weightless_tool(Scene(robot="ur5e", tool=Tool())))


@pytest.mark.parametrize(("arm", "mass"), RATED.items())
@pytest.mark.parametrize("mounting", ["table", "wall"])
def test_the_rated_payload_gives_no_warning(arm: str, mass: float, mounting: str) -> None:
    scene = Scene.model_validate(
        {"robot": arm, "mounting": mounting, "tool": {"mass": mass, "com": [0, 0, 0.1]}}
    )
    assert not list(load_warnings(scene))


@pytest.mark.parametrize(
    ("scene", "start"),
    [
        (
            Scene(robot="ur5e", tool=Tool(mass=15.0)),
            "tool: expected a weight that shoulder_lift_joint can hold",
        ),
        (
            Scene(robot="ur5e", tool=Tool(mass=1.0, com=(0.0, 0.0, 5.0))),
            "tool: expected a weight that wrist_1",
        ),
        (
            Scene(robot="ur5e", inertia={"forearm": LinkInertia(mass=8.0, com=(0, 0, 0), tensor=NONE)}),
            "inertia.forearm.mass: expected about the 2.85 kg of the robot's data, got 8 kg",
        ),
        (
            with_tensor(0.01, 0.01, 0.1),
            "inertia.forearm.tensor: expected the inertia of a body, whose principal moments are not "
            "negative and none larger than the sum of the others, got principal moments 0.01, 0.01, 0.1 kg",
        ),
        (
            with_tensor(4.0, 4.0, 0.1),
            "inertia.forearm.tensor: expected a largest principal moment of about the 0.0788 kg m^2 of "
            "the robot's data, got 4 kg m^2",
        ),
        (
            with_tensor(1e-5, 1e-5, 1e-6),
            "inertia.forearm.tensor: expected a largest principal moment of about",
        ),
        (
            Scene(robot="ur5e", joint_torque=JointTorqueSensor(noise=(1.0, 1.0, 1.0, 1.0, 28.0, 1.0))),
            "joint_torque.noise: expected a noise below the 28 Nm of wrist_2_joint, got 28 Nm",
        ),
        (
            Scene(robot="ur5e", joint_torque=JointTorqueSensor(friction=Friction(viscous=60.0))),
            "joint_torque.friction.viscous: expected a friction at the largest speed below the 150 Nm",
        ),
        (
            Scene(robot="ur5e", joint_torque=JointTorqueSensor(rotor_inertia=(100.0,) * 6)),
            "joint_torque.rotor_inertia: expected a torque to the largest speed within 0.5 s below",
        ),
        (
            Scene(robot="ur5e", base_wrench=WrenchSensor(force_noise=300.0)),
            "base_wrench.force_noise: expected less than the arm's own weight causes (213 N), got 300 N",
        ),
        (
            Scene(robot="ur5e", base_wrench=WrenchSensor(moment_noise=300.0)),
            "base_wrench.moment_noise: expected less than the arm's own weight causes",
        ),
    ],
)
def test_what_the_arm_cannot_have_is_told(scene: Scene, start: str) -> None:
    (found,) = load_warnings(scene)
    assert found.startswith(start)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"inertia": {"forearm": {"mass": 1000, "com": [0, 0, 0], "tensor": NONE}}},
            "inertia.forearm.mass: expected kg, at most the 21.7 kg of the arm itself, got 1000",
        ),
        (
            {"inertia": {"forearm": {"mass": 2.8, "com": [0, 0, 120], "tensor": NONE}}},
            "inertia.forearm.com: expected x, y, z in m",
        ),
        (
            {"inertia": {"forearm": {"mass": 2.8, "com": [0, 0, 0], "tensor": [2e4, 0, 0, 2e4, 0, 1e3]}}},
            r"inertia.forearm.tensor: expected kg m\^2, none above 17.5",
        ),
        (
            {"joint_torque": {"friction": {"coulomb": [1, 1, 1, 1e6, 1, 1]}}},
            "joint_torque.friction.coulomb: expected Nm, less than the 28 of wrist_1_joint, got 1e",
        ),
        ({"joint_torque": {"friction": {"lubricant": 28}}}, "joint_torque.friction.lubricant: expected Nm"),
        ({"joint_torque": {"friction": {"rest_error": 28}}}, "joint_torque.friction.rest_error: expected Nm"),
        (
            {"joint_torque": {"bias": -40}},
            "joint_torque.bias: expected Nm, less than the 28 of wrist_1_joint",
        ),
    ],
)
def test_what_no_part_of_the_arm_can_be_is_refused(fields: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scene(robot="ur5e", **fields)
