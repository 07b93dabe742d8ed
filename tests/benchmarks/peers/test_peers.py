"""The peers find a contact that fits their assumptions, and fail as their papers say they do."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.peers.exact_contact import ExactContact
from contactsense.benchmarks.peers.exploration_filter import ExplorationFilter
from contactsense.benchmarks.peers.force_line import ForceLine
from contactsense.benchmarks.peers.method import Answers, Method
from contactsense.benchmarks.peers.particle_filter import ParticleFilter
from contactsense.benchmarks.peers.torque_samples import TorqueSamples
from contactsense.benchmarks.peers.touches import Toucher, Touches, sensed
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.link_poses import link_poses
from contactsense.robots.surface.union import distances
from contactsense.scene_model.constants import build_constants

POSTURE = np.array([[0.3, -1.2, 1.4, -0.8, -1.1, 0.4]])
WRIST_2 = 5


def scene(base: bool = True, torque: bool = True) -> Scene:
    return Scene(
        robot="ur5e",
        base_wrench=WrenchSensor(force_noise=0.02, moment_noise=0.004) if base else None,
        joint_torque=JointTorqueSensor(noise=0.02) if torque else None,
    )


@pytest.fixture(scope="module")
def touches() -> Touches:
    """Contacts on the primitives themselves, so that nothing but the method is tried."""
    return Toucher(scene(), seed=4).draw(40)


def answers(method: Method, touches: Touches) -> Answers:
    return method(touches.q, touches.base_wrench[:, 0], touches.joint_torque[:, 0])


def errors(found: Answers, touches: Touches) -> np.ndarray:
    return np.linalg.norm(found.point_base - touches.point_base[:, 0], axis=1)


@pytest.mark.long
def test_wrench_axis_finds_every_contact_without_noise(touches: Touches) -> None:
    """The line of the true force enters the true link at the true place, unless an earlier entry hides it."""
    found = answers(ExactContact(scene(), closed_form=False), touches)
    assert np.median(errors(found, touches)) < 1e-6
    assert (errors(found, touches) < 1e-6).mean() >= 0.9


@pytest.mark.long
def test_closed_form_finds_every_contact_without_noise(touches: Touches) -> None:
    found = answers(ExactContact(scene(), closed_form=True), touches)
    assert np.median(errors(found, touches)) < 1e-6
    assert (errors(found, touches) < 1e-6).mean() >= 0.9


def test_exact_contacts_need_a_base_sensor() -> None:
    with pytest.raises(ValueError, match="base_wrench"):
        ExactContact(scene(base=False), closed_form=True)


@pytest.mark.slow
def test_force_line_is_right_where_the_last_joint_is_loaded(touches: Touches) -> None:
    found = answers(ForceLine(scene()), touches)
    right = found.link == touches.link[:, 0]
    assert right.mean() > 0.7
    assert np.median(errors(found, touches)[right]) < 1e-4


@pytest.mark.slow
def test_force_line_takes_the_link_before_a_joint_that_feels_nothing() -> None:
    """A force through the axis of the last joint before the touched link loads it with nothing: the rule's
    known blind spot."""
    arm = build_constants(scene())
    motion = empty_motion(6)
    forward_kinematics(arm.model, POSTURE[0], motion)
    point = motion.origin[WRIST_2] + 0.1 * np.array([0.0, 0.0, 1.0])
    force = 20.0 * (motion.origin[WRIST_2] - point) / 0.1
    wrench, torque = sensed(motion, WRIST_2, point, force)
    assert abs(torque[WRIST_2 - 1]) < 1e-12
    found = ForceLine(scene())(POSTURE, wrench[None], torque[None])
    assert found.link[0] < WRIST_2


def test_force_line_without_force_gives_no_answer() -> None:
    found = ForceLine(scene())(POSTURE, np.zeros((1, 6)), np.zeros((1, 6)))
    assert found.link[0] == -1


@pytest.mark.long
def test_particle_filter_finds_most_contacts_with_a_base_sensor(touches: Touches) -> None:
    """Mostly within 3 cm, as its paper says of joint torques on a simulated humanoid."""
    found = answers(ParticleFilter(scene()), touches)
    assert (errors(found, touches) < 0.03).mean() > 0.7


@pytest.mark.long
def test_particle_filter_cannot_place_a_contact_that_one_joint_feels(touches: Touches) -> None:
    """On the shoulder a single torque is all there is, and every place on it explains it."""
    toucher = Toucher(scene().model_copy(update={"touchable": ("shoulder",)}), seed=1)
    near_base = toucher.draw(20)
    found = ParticleFilter(scene(base=False))(near_base.q, None, near_base.joint_torque[:, 0])
    assert (errors(found, near_base) < 0.03).mean() < 0.5


@pytest.mark.long
def test_exploring_filter_finds_contacts_to_the_millimetre(touches: Touches) -> None:
    found = answers(ExplorationFilter(scene()), touches)
    assert (errors(found, touches) < 0.0225).mean() >= 0.9
    assert np.median(errors(found, touches)) < 2e-3


@pytest.mark.long
def test_exploring_filter_takes_contacts_one_after_another() -> None:
    wrist = scene().model_copy(update={"touchable": ("forearm", "wrist_1", "wrist_2", "wrist_3")})
    touches = Toucher(wrist, seed=2).draw(30, contacts=2, even=True)
    found = ExplorationFilter(wrist, contacts=2).follow(
        touches.q, np.cumsum(touches.base_wrench, axis=1), np.cumsum(touches.joint_torque, axis=1)
    )
    assert (found.link[:, 0, 1] == -1).mean() > 0.8, "one contact is explained by one set"
    gap = np.linalg.norm(found.point_base[:, 1] - touches.point_base, axis=-1)
    assert (gap.max(axis=1) < 0.0225).mean() > 0.7
    both = found.link[:, 1, 1] >= 0
    assert (found.link[both, 1, 0] != found.link[both, 1, 1]).all(), "at most one contact on a link"


@pytest.mark.long
def test_exploring_filter_takes_two_contacts_at_once_for_something_else() -> None:
    """It relies on contacts that arrive one after another."""
    wrist = scene().model_copy(update={"touchable": ("forearm", "wrist_1", "wrist_2", "wrist_3")})
    touches = Toucher(wrist, seed=2).draw(30, contacts=2, even=True)
    found = ExplorationFilter(wrist, contacts=2).follow(
        touches.q, touches.base_wrench.sum(axis=1)[:, None], touches.joint_torque.sum(axis=1)[:, None]
    )
    gap = np.linalg.norm(found.point_base[:, 0, :, None] - touches.point_base[:, None], axis=-1)
    assert (gap.min(axis=1).max(axis=1) < 0.0225).mean() < 0.5


def test_exploring_filter_needs_a_sensor() -> None:
    with pytest.raises(ValueError, match="base_wrench, joint_torque"):
        ExplorationFilter(scene())(POSTURE, None, None)


@pytest.mark.long
def test_torque_samples_explain_the_torques() -> None:
    """The answer may be far from the truth, but a push there has the same torques: the paper's point."""
    alone = scene(base=False)
    touches = Toucher(alone, seed=3).draw(12)
    found = TorqueSamples(alone, spacing=0.02)(touches.q, None, touches.joint_torque[:, 0])
    motion, model = empty_motion(6), build_model(alone.robot)
    explained = 0
    for i, (q, torque) in enumerate(zip(touches.q, touches.joint_torque[:, 0], strict=True)):
        forward_kinematics(model, q, motion)
        point, proximal = found.point_base[i], np.arange(6) < found.link[i]
        # Torques of unit forces along x, y, z; those of the best force.
        force, moment = motion.screw[:, :3], np.cross(motion.screw[:, 3:], point)
        by_force = -(force + moment) * proximal[:, None]
        best = by_force @ np.linalg.lstsq(by_force, torque)[0]
        explained += bool(np.linalg.norm(best - torque) < 0.1 * np.linalg.norm(torque))
    assert explained >= 9


def test_torque_samples_refuse_a_base_sensor() -> None:
    with pytest.raises(ValueError, match="joint torques alone"):
        TorqueSamples(scene())


@pytest.mark.slow
def test_contacts_are_on_the_surface_and_push(touches: Touches) -> None:
    push = np.einsum("nki,nki->nk", touches.force_base, touches.normal_base)
    np.testing.assert_allclose(np.linalg.norm(touches.force_base, axis=-1), 20.0)
    assert (push < -20.0 / np.sqrt(1.0 + 0.5**2) + 1e-9).all()
    surfaces = build_constants(scene()).surfaces
    for q, link, point, normal in zip(touches.q, *(c[:, 0] for c in touches[1:4]), strict=True):
        pose = link_poses(scene().robot, q)[link]
        local = (pose[:3, :3].T @ (point - pose[:3, 3]))[None]
        gap, _, outward = distances(surfaces, local, int(link))
        assert abs(gap[0]) < 1e-9
        np.testing.assert_allclose(pose[:3, :3] @ outward[0], normal, atol=1e-6)


def test_what_is_sensed_is_what_the_dynamics_say(touches: Touches) -> None:
    """A force in reach of the joints below the link only: against the Jacobian by differences."""
    robot = scene().robot
    for i in range(3):
        link, point = int(touches.link[i, 0]), touches.point_base[i, 0]
        pose = link_poses(robot, touches.q[i])[link]
        local = np.linalg.solve(pose, np.append(point, 1.0))
        for j in range(6):
            step = np.zeros(6)
            step[j] = 1e-6
            moved = [(link_poses(robot, touches.q[i] + sign * step)[link] @ local)[:3] for sign in (1, -1)]
            work = (moved[0] - moved[1]) @ touches.force_base[i, 0] / 2e-6
            assert touches.joint_torque[i, 0, j] == pytest.approx(-work, abs=1e-6)
