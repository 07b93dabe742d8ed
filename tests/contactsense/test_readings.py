"""The forward model against the simulated arm, which has its own dynamics."""

import numpy as np
import pytest

from contactsense import LinkWrenchSensor, Scene, WrenchSensor, forward_model
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots import load
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate


@pytest.mark.slow
def test_it_reads_what_the_simulated_arm_reads_at_rest() -> None:
    script = Script.demo()
    quiet = script.model_copy(
        update={
            "noise": script.noise.model_copy(
                update={"base_force": 0.0, "base_moment": 0.0, "joint_torque": 0.0}
            )
        }
    )
    motion = simulate(quiet)
    scene = Scene(robot="ur5e", gravity=float(np.linalg.norm(script.gravity)))
    for touch in motion.touches[:2]:
        at = touch.first + len(touch.torsion) // 2
        readings = forward_model(
            scene, motion.q[at], touch.link, touch.point_link, touch.force_base[at - touch.first]
        )
        np.testing.assert_allclose(readings.joint_torque, motion.joint_torque[at], atol=1e-9)
        np.testing.assert_allclose(readings.base_wrench, motion.base_wrench[at], atol=1e-9)


def test_torsion_acts_about_the_normal() -> None:
    scene, q = Scene(robot="ur5e"), np.array([0.1, -1.2, 1.4, -1.0, -1.5, 0.3])
    place, force, normal = np.array([-0.1, 0.0, 0.05]), np.zeros(3), np.array([0.0, 0.6, 0.8])
    readings = forward_model(scene, q, "forearm", place, force, 0.3, normal, external=True)
    np.testing.assert_allclose(readings.base_wrench, [0, 0, 0, *(0.3 * normal)], atol=1e-15)
    np.testing.assert_array_equal(readings.joint_torque[3:], 0.0)


@pytest.mark.parametrize("touched", ["upper_arm", "forearm", "wrist_3", "gripper"])
@pytest.mark.parametrize("external", [False, True])
def test_a_joint_holds_what_a_sensor_beyond_it_carries(touched: str, external: bool) -> None:
    """The actuator balances the moment about its axis of the wrench that the link beyond it carries."""
    arm = load("ur5e")
    tool = {
        "name": "gripper", "mass": 1.5, "com": (0.01, -0.02, 0.06),
        "primitives": [{"kind": "sphere", "center": (0.0, 0.0, 0.08), "radius": 0.05}],
    }  # fmt: skip
    scene = Scene.model_validate(
        {
            "robot": arm,
            "tool": tool,
            "mounting": (0.3, -0.2, 0.0),
            "wrist_wrench": WrenchSensor(),
            "link_wrenches": [LinkWrenchSensor(name=name, link=name) for name in arm.link_names[1:]],
        }
    )
    q, motion = np.array([0.1, -1.2, 1.4, -1.0, -1.5, 0.3]), empty_motion(6)
    forward_kinematics(build_model(arm), q, motion)
    force = np.array([3.0, -7.0, 20.0])
    found = forward_model(scene, q, touched, np.array([-0.1, 0.02, 0.05]), force, external=external)
    for joint, name in enumerate(arm.link_names[1:]):
        moment = motion.screw[joint] @ found.link_wrenches[name]
        assert found.joint_torque[joint] == pytest.approx(-moment, abs=1e-12)
    carried = 0.0 if external else 1.5 * scene.gravity_base
    assert found.wrist_wrench is not None
    np.testing.assert_allclose(found.wrist_wrench[:3], carried + force * (touched == "gripper"), atol=1e-12)
    # The last link and the tool together: the weight of that link is the difference of both sensors.
    alone = scene.robot.links[-1].inertia.mass * scene.gravity_base * (not external)
    both = found.link_wrenches["wrist_3"][:3] - force * (touched == "wrist_3")
    np.testing.assert_allclose(both - found.wrist_wrench[:3], alone, atol=1e-12)


def test_a_sensor_that_the_scene_lacks_has_no_readings() -> None:
    found = forward_model(Scene(robot="ur5e"), np.zeros(6), "forearm", np.zeros(3), np.zeros(3))
    assert found.wrist_wrench is None
    assert found.link_wrenches == {}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"link": "knee"}, "link: expected one of base, "),
        ({"point": np.zeros(2)}, r"point: expected shape \(3,\)"),
        (
            {"point": np.array([40.0, 0.0, 15.0])},
            r"point: expected x, y, z in m, none above 5, got \[40.0, 0.0, 15.0\]; if these are mm: \[0.04, ",
        ),
        ({"q": np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])}, "q: .* got -90; are they in degrees"),
        ({"torsion": 1.0}, "normal: expected the outward normal"),
        ({"torsion": 1.0, "normal": np.array([0.0, 0.0, 2.0])}, "normal: expected a unit vector, got .*2.0"),
        (
            {"torsion": np.nan, "normal": np.array([0.0, 0.0, 1.0])},
            "torsion: expected a finite number, got nan",
        ),
        ({"torsion": "0.1"}, "torsion: expected a finite number, got '0.1'"),
        ({"external": "no"}, "external: expected True or False, got 'no'"),
    ],
)
def test_bad_arguments_are_named(changes: dict[str, object], message: str) -> None:
    arguments = {"q": np.zeros(6), "link": "forearm", "point": np.zeros(3), "force": np.zeros(3)} | changes
    with pytest.raises(ValueError, match=message):
        forward_model(Scene(robot="ur5e"), **arguments)  # type: ignore[arg-type]
