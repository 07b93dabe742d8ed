"""The classical pipeline: the link from the sensors, the contact on it by the paper's closed form."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor, forward_model
from contactsense.localization.intrinsic_contact import centroid_covariance
from contactsense.sample_blocks import SampleBlock
from contactsense.solvers import Box, Status, solve
from tests.plain_arm import contacts, plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

ARM = plain_ur5e()
PRECISE = Scene(
    robot=ARM,
    base_wrench=WrenchSensor(force_noise=1e-5, moment_noise=1e-6),
    joint_torque=JointTorqueSensor(noise=1e-4),
)


@pytest.fixture(scope="module")
def precise() -> Localizer:
    return Localizer(PRECISE, "intrinsic")


def test_exact_readings_give_the_exact_contact(precise: Localizer) -> None:
    truth = contacts(ARM, 300, seed=1)
    found = precise.locate_batch(truth.q, base_wrench=truth.base_wrench, joint_torque=truth.torque)
    right = found.link == truth.link
    error = np.linalg.norm(found.point_base - truth.point, axis=1)
    exact = right & (error < 1e-6)
    # The line of a force meets a link of several primitives more than once: another contact then explains
    # the wrench as well, with less torsion.
    assert exact.mean() > 0.85
    np.testing.assert_allclose(found.torsion[exact], truth.torsion[exact], atol=1e-6)
    np.testing.assert_allclose(found.normal_base[exact], truth.normal[exact], atol=1e-4)
    # Every answer balances the wrench.
    balanced = np.cross(found.point_base, found.force_base) + found.torsion[:, None] * found.normal_base
    answered = found.link >= 0
    np.testing.assert_allclose(balanced[answered], truth.base_wrench[answered, 3:], atol=1e-6)


def test_one_measurement_and_a_batch_give_the_same_contact(precise: Localizer) -> None:
    truth = contacts(ARM, 20, seed=2)
    found = precise.locate_batch(truth.q, base_wrench=truth.base_wrench, joint_torque=truth.torque)
    for i in range(20):
        one = precise.locate(truth.q[i], base_wrench=truth.base_wrench[i], joint_torque=truth.torque[i])
        if found.link[i] < 0:
            assert one.status == "ambiguous"
            continue
        assert one.status == "contact"
        assert one.contacts[0].link_index == found.link[i]
        assert one.contacts[0].probability == 1.0
        np.testing.assert_array_equal(one.contacts[0].point_base, found.point_base[i])


def test_a_stream_and_its_blocks_find_the_contact(precise: Localizer) -> None:
    truth = contacts(ARM, 1, seed=5)
    torque, weight = forward_model(PRECISE, truth.q[0], "base", np.zeros(3), np.zeros(3))[:2]
    samples = [
        Sample(
            0.002 * i,
            truth.q[0],
            np.zeros(6),
            torque + (truth.torque[0] if i >= 150 else 0.0),
            weight + (truth.base_wrench[0] if i >= 150 else 0.0),
        )
        for i in range(300)
    ]
    estimates = list(precise.run(samples))
    assert estimates[149].status == "none"
    assert estimates[-1].status == "contact"
    assert estimates[-1].contacts[0].link_index == truth.link[0]
    np.testing.assert_allclose(estimates[-1].contacts[0].point_base, truth.point[0], atol=1e-4)
    fields = ("t", "q", "qd", "joint_torque", "base_wrench")
    block = SampleBlock(*(np.array([getattr(sample, name) for sample in samples]) for name in fields))
    (found,) = precise.run_blocks([block])
    at = found.sample == 299
    np.testing.assert_allclose(found.rows[at][0, 7:10], estimates[-1].contacts[0].point_base, atol=1e-9)


def test_pulls_have_no_contact(precise: Localizer) -> None:
    truth = contacts(ARM, 50, seed=3)
    found = precise.locate_batch(truth.q, base_wrench=-truth.base_wrench, joint_torque=-truth.torque)
    # A pull is a push on the far side, if the line meets the link there without much torsion.
    answered = found.link >= 0
    push = -np.einsum("ij,ij->i", found.force_base, found.normal_base)
    assert (push[answered] > 0.0).all()
    np.testing.assert_allclose(found.force_base[answered], -truth.force[answered], rtol=1e-3, atol=1e-3)


def test_the_covariance_is_that_of_small_errors() -> None:
    box = Box(0.15, 0.1, 0.05, 0.0)
    rng = np.random.default_rng(0)
    force, centroid = np.array([1.0, 2.0, -20.0]), np.array([0.05, -0.03, 0.05])
    wrench = np.concatenate((force, np.cross(centroid, force)))
    factor = 1e-4 * rng.standard_normal((6, 6))
    expected = np.zeros((3, 3))
    normal = np.array([0.0, 0.0, 1.0])
    centroid_covariance(tuple(centroid), tuple(normal), tuple(force), factor @ factor.T, 0.0, expected)
    shifts = []
    for _ in range(4000):
        changed = wrench + factor @ rng.standard_normal(6)
        found = solve(box, changed[:3], changed[3:])
        assert found.status == Status.OK
        shifts.append(found.centroid - centroid)
    np.testing.assert_allclose(np.cov(np.array(shifts).T, bias=True), expected, rtol=0.1, atol=1e-13)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (Scene(robot=ARM, base_wrench=None), "got no base_wrench"),
        (Scene(robot=ARM, contacts=2), "got contacts: 2"),
    ],
)
def test_scenes_that_it_cannot_serve_are_refused(scene: Scene, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Localizer(scene, "intrinsic")


def test_a_measurement_without_base_wrench_is_refused(precise: Localizer) -> None:
    with pytest.raises(ValueError, match="base_wrench: expected a value"):
        precise.locate(np.zeros(6), joint_torque=np.zeros(6))
