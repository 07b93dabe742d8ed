"""The real surface is not where the primitives are: a little off in most places, by millimetres in few."""

import numpy as np
from scipy.stats import chi2

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 300, seed=1)
SCENE = Scene(
    robot=ARM,
    base_wrench=WrenchSensor(force_noise=0.002, moment_noise=0.0004),
    joint_torque=JointTorqueSensor(noise=0.002),
)


def test_regions_hold_the_truth_where_the_surface_is_off_as_stated() -> None:
    """Contacts on a surface that is raised and tilted by as much as the scene takes it to be, no noise: 90 %
    ellipses hold about so many of them; without the tilt's part of the covariance it would be a third."""
    scene = Scene(robot=ARM, base_wrench=SCENE.base_wrench)
    rng = np.random.default_rng(5)
    count = len(TRUTH.q)
    normal, force = TRUTH.normal, TRUTH.force
    point = TRUTH.point + rng.normal(0.0, scene.surface_deviation, (count, 1)) * normal
    # 8 degrees each way; the part along the normal does not turn it.
    tilted = normal + rng.normal(0.0, np.radians(8.0), (count, 3))
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    wrench = np.hstack((force, np.cross(point, force) + TRUTH.torsion[:, None] * tilted))
    found = Localizer(scene).locate_batch(TRUTH.q, base_wrench=wrench)
    held = []
    for i in np.flatnonzero(found.link == TRUTH.link):
        n = found.normal_base[i]
        off = point[i] - found.point_base[i]
        if np.linalg.norm(off) < 0.01:
            along = np.linalg.svd(np.eye(3) - np.outer(n, n))[0][:, :2]
            covariance = along.T @ found.covariance[i] @ along
            held.append(along.T @ off @ np.linalg.solve(covariance, along.T @ off) < chi2.ppf(0.9, 2))
    assert len(held) > 0.9 * count
    assert 0.87 < np.mean(held) < 0.96


def test_a_push_on_a_bump_beside_the_primitive_has_an_answer() -> None:
    """The force passes the upper arm's capsule by 3 mm, six standard deviations of the surface's error."""
    q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
    motion = empty_motion(6)
    forward_kinematics(build_model(ARM), q, motion)
    R, o = motion.rotation[2], motion.origin[2]
    point = R @ np.array([-0.2, 0.0, 0.138 + 0.05 + 0.003]) + o
    force = R @ np.array([0.0, 20.0, 0.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    torque = np.where(np.arange(6) < 2, -motion.screw @ wrench, 0.0)
    answer = Localizer(SCENE).locate(q, base_wrench=wrench, joint_torque=torque)
    assert answer.status == "contact"
    assert answer.contacts[0].link == "upper_arm"
    assert np.linalg.norm(answer.contacts[0].point_base - point) < 0.02
