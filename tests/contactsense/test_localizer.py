"""Static answers, one or many, on constructed truth."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.primitives import Capsule
from contactsense.robots.tool import Tool
from tests.at_rest import weight
from tests.contactsense.precise import PRECISE
from tests.plain_arm import contacts

ARM = PRECISE.robot
TRUTH = contacts(ARM, 300, seed=1)


def test_precise_sensors_find_link_point_force_and_torsion(precise: Localizer) -> None:
    found = precise.locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    right = found.link == TRUTH.link
    assert right.mean() > 0.99
    error = np.linalg.norm(found.point_base - TRUTH.point, axis=1)[right]
    # A wrench may pass through two places of one link; all but a few contacts are unambiguous.
    assert np.median(error) < 1e-4
    assert np.quantile(error, 0.95) < 1e-3
    good = right & (np.linalg.norm(found.point_base - TRUTH.point, axis=1) < 1e-3)
    np.testing.assert_allclose(found.force_base[good], TRUTH.force[good], atol=0.05)
    np.testing.assert_allclose(found.torsion[good], TRUTH.torsion[good], atol=0.02)
    assert np.median(np.sum(found.normal_base[good] * TRUTH.normal[good], axis=1)) > 0.9999
    assert found.detected.all()


def test_its_representation_names_arm_and_sensors(ordinary: Localizer) -> None:
    expected = f"<Localizer {ordinary.scene.robot.name}: base_wrench, joint_torque>"
    assert repr(ordinary) == expected


def test_one_sample_and_a_batch_give_the_same_answer(ordinary: Localizer) -> None:
    batch = ordinary.locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    for i in range(20):
        one = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        best = one.contacts[0]
        assert best.link_index == batch.link[i]
        np.testing.assert_array_equal(best.point_base, batch.point_base[i])
        np.testing.assert_array_equal(best.force_base, batch.force_base[i])
        np.testing.assert_array_equal(one.link_probability, batch.link_probability[i])
        assert best.probability == batch.probability[i]


def test_probabilities_are_of_one_whole_and_sorted(ordinary: Localizer) -> None:
    for i in range(50):
        one = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        p = [contact.probability for contact in one.contacts]
        assert p == sorted(p, reverse=True)
        assert sum(p) + one.other == pytest.approx(1.0)
        assert 0.5 < one.link_probability.sum() <= 1.0 + 1e-12
        assert one.status == ("contact" if p[0] >= 0.95 else "ambiguous")


def test_the_point_in_the_link_frame_is_the_point_in_the_base_frame(precise: Localizer) -> None:
    motion, model = empty_motion(6), build_model(ARM)
    for i in range(20):
        one = precise.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        best = one.contacts[0]
        forward_kinematics(model, TRUTH.q[i], motion)
        back = motion.rotation[best.link_index] @ best.point + motion.origin[best.link_index]
        np.testing.assert_allclose(back, best.point_base, atol=1e-12)
        assert best.link == ARM.link_names[best.link_index]
        assert np.linalg.norm(best.normal_base) == pytest.approx(1.0)
        assert best.force_base @ best.normal_base < 0.0
        assert np.linalg.eigvalsh(best.covariance).min() > -1e-18


@pytest.mark.parametrize("mounting", ["table", "ceiling", "wall", (0.4, -0.2, 1.0)])
def test_gravity_is_compensated_for_every_mounting(mounting: str | tuple[float, float, float]) -> None:
    scene = PRECISE.model_copy(update={"mounting": mounting})
    localizer = Localizer(scene)
    for i in range(5):
        torque, wrench = weight(scene, TRUTH.q[i])
        a = localizer.locate(
            TRUTH.q[i],
            base_wrench=TRUTH.base_wrench[i] + wrench,
            joint_torque=TRUTH.torque[i] + torque,
            external=False,
        )
        b = localizer.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        np.testing.assert_allclose(a.contacts[0].point_base, b.contacts[0].point_base, atol=1e-6)
        assert a.contacts[0].link == b.contacts[0].link


def test_rotation_about_the_base_axis_rotates_the_estimate(ordinary: Localizer) -> None:
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for i in range(20):
        q = TRUTH.q[i].copy()
        q[0] += angle
        wrench = np.concatenate((turn @ TRUTH.base_wrench[i, :3], turn @ TRUTH.base_wrench[i, 3:]))
        a = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        b = ordinary.locate(q, base_wrench=wrench, joint_torque=TRUTH.torque[i])
        # The base link does not turn with the joint, but it is round: a contact on it turns along.
        assert a.contacts[0].link == b.contacts[0].link
        np.testing.assert_allclose(turn @ a.contacts[0].point_base, b.contacts[0].point_base, atol=2e-4)


def test_more_force_and_more_noise_in_proportion_change_nothing() -> None:
    scene = Scene(robot=ARM, surface_error=1e-4)
    assert scene.base_wrench is not None
    joints = tuple(replace(joint, torque_limit=1e3 * joint.torque_limit) for joint in ARM.joints)
    louder = scene.model_copy(
        update={
            "robot": replace(ARM, joints=joints),
            "base_wrench": WrenchSensor(force_noise=250.0, moment_noise=50.0, range=(1e6, 1e6)),
            "joint_torque": JointTorqueSensor(noise=1000.0),
            "force": 1e3 * scene.force,
        }
    )
    a = Localizer(scene).locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    b = Localizer(louder).locate_batch(
        TRUTH.q, base_wrench=1e3 * TRUTH.base_wrench, joint_torque=1e3 * TRUTH.torque
    )
    np.testing.assert_array_equal(a.link, b.link)
    np.testing.assert_allclose(a.point_base, b.point_base, atol=1e-6)
    np.testing.assert_allclose(1e3 * a.force_base, b.force_base, atol=1e-3)


def test_geometry_resolves_the_ambiguity_of_the_torques() -> None:
    """At ordinary noise the joint decision finds the link far more often than the torques' evidence alone."""
    chance = np.random.default_rng(8)
    truth = contacts(ARM, 600, seed=9)
    wrench = truth.base_wrench + chance.standard_normal((600, 6)) * np.array([0.25] * 3 + [0.05] * 3)
    torque = truth.torque + chance.standard_normal((600, 6))
    right = {}
    for method in ("joint", "torques_first"):
        found = Localizer(Scene(robot=ARM, surface_error=1e-4), method).locate_batch(
            truth.q, base_wrench=wrench, joint_torque=torque
        )
        right[method] = np.mean(found.link == truth.link)
    assert right["joint"] > 0.85
    assert right["joint"] > right["torques_first"] + 0.2


@pytest.mark.parametrize("sensors", ["base", "torques"])
def test_either_sensor_alone_gives_an_estimate(sensors: str) -> None:
    scene = PRECISE.model_copy(update={"joint_torque" if sensors == "base" else "base_wrench": None})
    given = {"base_wrench": TRUTH.base_wrench} if sensors == "base" else {"joint_torque": TRUTH.torque}
    found = Localizer(scene).locate_batch(TRUTH.q, **given)
    assert np.isfinite(found.point_base).all()
    beyond = TRUTH.link >= (0 if sensors == "base" else 5)
    error = np.linalg.norm(found.point_base - TRUTH.point, axis=1)[beyond]
    right = (found.link == TRUTH.link)[beyond]
    if sensors == "base":
        assert np.median(error) < 1e-3
        assert right.mean() > 0.8
    else:
        assert right.mean() > 0.6


def test_a_wrist_sensor_distinguishes_tool_from_wrist() -> None:
    tool = Tool(
        name="finger",
        mass=0.5,
        com=(0, 0, 0.1),
        primitives=(Capsule(a=(0, 0, 0.03), b=(0, 0, 0.2), radius=0.015),),
    )
    scene = PRECISE.model_copy(
        update={"tool": tool, "wrist_wrench": WrenchSensor(force_noise=0.1, moment_noise=0.01)}
    )
    localizer = Localizer(scene)
    q = np.array([0.3, -1.2, 1.5, -1.0, -1.4, 0.4])
    motion = empty_motion(6)
    forward_kinematics(build_model(ARM), q, motion)
    flange = motion.rotation[6] @ ARM.flange_rotation
    origin = motion.rotation[6] @ ARM.flange_translation + motion.origin[6]
    point = flange @ np.array([0.015, 0.0, 0.15]) + origin
    force = flange @ np.array([-12.0, 1.0, 2.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    found = localizer.locate(q, base_wrench=wrench, joint_torque=-motion.screw @ wrench, wrist_wrench=wrench)
    assert found.contacts[0].link == "finger"
    np.testing.assert_allclose(found.contacts[0].point, [0.015, 0.0, 0.15], atol=1e-3)
    assert len(found.link_probability) == 8
    # A push along the finger enters its tip and, further along the same line, the wrist: only the wrist
    # sensor knows.
    point = flange @ np.array([0.004, 0.0, 0.2]) + origin
    force = flange @ np.array([0.0, 0.0, -15.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    both = {"base_wrench": wrench, "joint_torque": -motion.screw @ wrench}
    assert localizer.locate(q, **both, wrist_wrench=wrench).contacts[0].link == "finger"
    below = localizer.locate(q, **both, wrist_wrench=np.zeros(6))
    assert below.contacts[0].link in {"wrist_2", "wrist_3"}
    assert below.link_probability[7] < 1e-6


def test_links_that_cannot_be_touched_are_never_named() -> None:
    scene = PRECISE.model_copy(update={"touchable": ("forearm", "wrist_1")})
    found = Localizer(scene).locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    assert set(found.link.tolist()) <= {-1, 3, 4}


def test_the_face_on_which_the_base_stands_cannot_be_touched(precise: Localizer) -> None:
    wrench = np.array([0.0, 0.0, 30.0, 0.3, -0.2, 0.0])  # upwards, through the base
    found = precise.locate(np.zeros(6), base_wrench=wrench, joint_torque=np.zeros(6))
    assert all(c.point_base[2] > 1e-3 or c.normal_base[2] > -0.5 for c in found.contacts)


def test_noise_alone_is_no_contact_at_the_stated_rate() -> None:
    scene = Scene(robot=ARM, false_alarms_per_hour=0.01 * 3600.0 * 2.0 * np.pi * 10.0)
    chance = np.random.default_rng(2)
    n = 4000
    found = Localizer(scene).locate_batch(
        chance.uniform(-3, 3, (n, 6)),
        base_wrench=chance.standard_normal((n, 6)) * np.array([0.25] * 3 + [0.05] * 3),
        joint_torque=chance.standard_normal((n, 6)),
    )
    # 40 expected of 4000: six standard deviations either way.
    assert 8 <= found.detected.sum() <= 78


def test_zero_measurement_is_no_contact(ordinary: Localizer) -> None:
    quiet = ordinary.locate(np.zeros(6), base_wrench=np.zeros(6), joint_torque=np.zeros(6))
    assert quiet.status == "none"
    assert quiet.contacts == ()
    assert quiet.link_probability.sum() == 0.0


def test_a_contact_known_to_be_there_is_looked_for_below_the_threshold(ordinary: Localizer) -> None:
    weak = 0.01 * TRUTH.base_wrench[0]
    assert ordinary.locate(TRUTH.q[0], base_wrench=weak).status == "none"
    assert ordinary.locate(TRUTH.q[0], base_wrench=weak, detect=False).contacts


def test_estimates_and_contacts_are_equal_to_themselves_alone(ordinary: Localizer) -> None:
    measured = {"base_wrench": TRUTH.base_wrench[0], "joint_torque": TRUTH.torque[0]}
    one, other = ordinary.locate(TRUTH.q[0], **measured), ordinary.locate(TRUTH.q[0], **measured)
    assert one.contacts.index(one.contacts[-1]) == len(one.contacts) - 1
    assert one != other
    assert len({one, other, *one.contacts}) == 2 + len(one.contacts)


def test_estimates_without_contact_are_read_only(precise: Localizer) -> None:
    """They share their arrays: a change in one would be a change in all."""
    quiet = precise.locate(np.zeros(6), base_wrench=np.zeros(6), joint_torque=np.zeros(6))
    for array in (quiet.link_probability, quiet.wrench, quiet.covariance):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)
def test_a_copy_answers_from_its_own_measurements(
    ordinary: Localizer, duplicate: Callable[[Localizer], Localizer]
) -> None:
    def force(localizer: Localizer, i: int) -> np.ndarray:
        found = localizer.locate(
            TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i], detect=False
        )
        return found.wrench

    other = duplicate(ordinary)
    first, second = force(ordinary, 0), force(ordinary, 1)
    np.testing.assert_array_equal(force(other, 0), first)
    force(ordinary, 0)
    np.testing.assert_array_equal(force(other, 1), second)
    assert other.scene == ordinary.scene


def test_joint_torques_of_less_noise_within_a_context() -> None:
    """A mean of 16 samples has a quarter of their noise; afterwards all is as before."""
    scene = Scene(robot="ur5e", base_wrench=None, joint_torque=JointTorqueSensor(noise=1.0))
    quiet = Scene(robot="ur5e", base_wrench=None, joint_torque=JointTorqueSensor(noise=0.25))
    q, torque = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0]), np.array([0.63, -3.22, -3.47, 0.0, 0.0, 0.0])
    localizer = Localizer(scene)

    def answer(of: Localizer) -> np.ndarray:
        return of.locate(q, joint_torque=torque, detect=False).link_probability

    before = answer(localizer)
    ratio = Localizer(quiet).constants.sensors.torque_variance / localizer.constants.sensors.torque_variance
    with localizer.torque_variance(localizer.constants.sensors.torque_variance * ratio):
        np.testing.assert_allclose(answer(localizer), answer(Localizer(quiet)), rtol=1e-9)
        assert not np.allclose(answer(localizer), before, rtol=1e-3)
    np.testing.assert_array_equal(answer(localizer), before)
    with pytest.raises(RuntimeError, match="within"), localizer.torque_variance(np.ones(6)):
        raise RuntimeError("within")
    np.testing.assert_array_equal(answer(localizer), before)


@pytest.mark.parametrize("variance", [np.ones(5), np.zeros(6), np.full(6, np.nan)])
def test_a_variance_that_no_sensor_has_is_refused(variance: np.ndarray) -> None:
    localizer = Localizer(Scene(robot="ur5e"))
    before = localizer.constants.sensors.torque_variance.copy()
    with pytest.raises(ValueError, match=r"^variance: expected 6 finite positive numbers"):  # noqa: SIM117
        with localizer.torque_variance(variance):
            raise AssertionError("not reached")
    np.testing.assert_array_equal(localizer.constants.sensors.torque_variance, before)
