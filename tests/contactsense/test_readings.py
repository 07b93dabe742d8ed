"""The forward model against the simulated arm, which has its own dynamics."""

import numpy as np
import pytest

from contactsense import Scene, forward_model
from contactsense.service.mock.script import Script
from contactsense.service.mock.simulated_arm import simulate


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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"link": "knee"}, "link: expected one of base, "),
        ({"point": np.zeros(2)}, r"point: expected shape \(3,\)"),
        ({"torsion": 1.0}, "normal: expected the outward normal"),
    ],
)
def test_bad_arguments_are_named(changes: dict[str, object], message: str) -> None:
    arguments = {"q": np.zeros(6), "link": "forearm", "point": np.zeros(3), "force": np.zeros(3)} | changes
    with pytest.raises(ValueError, match=message):
        forward_model(Scene(robot="ur5e"), **arguments)  # type: ignore[arg-type]
