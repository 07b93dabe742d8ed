"""Smoothing without a base sensor: one direction of the torques in a stretch, evidence over all stretches."""

from collections.abc import Sequence

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock, Scene
from contactsense.kinematics.model import build_model
from contactsense.runtime.result_rows import LINK
from contactsense.service.analysis.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.smoothing import ContactSmoother
from contactsense.service.analysis.torque_smoothing import TorqueSmoother, _magnitudes
from contactsense.service.mock.script import Script
from contactsense.service.mock.simulated_arm import Motion, Touch, simulate
from tests.plain_arm import plain_ur5e
from tests.service.analysis.recordings import demo

SCENE = Scene(robot="ur5e", base_wrench=None)


def _histories(motion: Motion, localizer: Localizer) -> list[ContactHistory]:
    """The contacts found from the torques."""
    block = SampleBlock(motion.t, motion.q, motion.qd, motion.joint_torque)
    collector, found, at = ContactCollector(SCENE.bandwidth), [], 0
    for part in localizer.run_blocks([block]):
        found += collector.add(np.arange(at, at + len(part)), block[at : at + len(part)], part)
        at += len(part)
    return found


@pytest.fixture(scope="module")
def contacts() -> Sequence[tuple[ContactHistory, Touch]]:
    """The contacts found from the torques, each with the truth at its middle."""
    motion = demo()
    found = _histories(motion, Localizer(SCENE))
    middle = [0.5 * (history.t[0] + history.t[-1]) for history in found]
    return [
        (history, touch)
        for history, t in zip(found, middle, strict=True)
        for touch in motion.touches
        if touch.start <= t <= touch.stop and len(history.rows)
    ]


def test_the_link_is_named_at_least_as_often_as_live(
    contacts: Sequence[tuple[ContactHistory, Touch]],
) -> None:
    smoother, live, whole, answers = ContactSmoother(SCENE), [], [], 0
    for history, touch in contacts:
        found = smoother.smooth(history)
        live.append(history.rows[-1, LINK] == touch.link_index)
        # Where one contact does not explain the torques, the live answer is kept.
        whole.append(live[-1] if found is None else found.best.link == touch.link_index)
        if found is not None:
            answers += 1
            assert found.link_probability.sum() == pytest.approx(1.0)
            assert len(found.best.point) == len(found.windows.t)
    assert answers >= len(contacts) // 2 >= 2
    assert np.mean(whole) >= np.mean(live)
    assert np.mean(whole) > 0.7


def test_answers_do_not_depend_on_the_contacts_before(
    contacts: Sequence[tuple[ContactHistory, Touch]],
) -> None:
    fresh, used = ContactSmoother(SCENE), ContactSmoother(SCENE)
    forward = [fresh.smooth(history) for history, _ in contacts]
    backward = [used.smooth(history) for history, _ in reversed(contacts)][::-1]
    for one, other in zip(forward, backward, strict=True):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            np.testing.assert_array_equal(one.best.point, other.best.point)
            np.testing.assert_array_equal(one.link_probability, other.link_probability)


@pytest.mark.parametrize("second", [0, 2, 7])
def test_contacts_that_overlap_are_not_one_contact(second: int) -> None:
    """The upper arm is touched for 0.8 s, forearm or first wrist from 0.1 s before its release on.

    Some contact explains each stretch, also the one in which both act, but none explains all. The product of
    the stretches' evidence named a link that is not touched at all, with up to 0.98.
    """
    script = Script.demo()
    first, other = script.contacts[1], script.contacts[second]
    assert first.link == "upper_arm"
    assert other.link in ("forearm", "wrist_1")
    script = script.model_copy(
        update={
            "trajectory": script.trajectory.model_copy(update={"dwell": 2.5, "moves": ()}),
            "contacts": (
                first.model_copy(update={"start": 1.0, "duration": 0.8}),
                other.model_copy(update={"start": 1.7, "duration": 0.4}),
            ),
        }
    )
    (history,) = _histories(simulate(script), Localizer(SCENE))
    assert ContactSmoother(SCENE).smooth(history) is None


def test_torques_in_one_direction_are_one_reading() -> None:
    rng = np.random.default_rng(0)
    direction = np.array([3.0, -2.0, 1.0, 0.5, 0.0, 0.0])
    force, samples = np.linspace(0.2, 2.0, 10), np.full(10, 25.0)
    torque = force[:, None] * direction + rng.standard_normal((10, 6)) / np.sqrt(samples)[:, None]
    scale, fits = _magnitudes(torque, samples)
    assert fits
    np.testing.assert_allclose(scale, force / np.sqrt(np.mean(force**2)), atol=0.2)
    # Another direction in the second half.
    torque[5:] = force[5:, None] * direction[::-1]
    assert not _magnitudes(torque, samples)[1]


def test_the_prior_over_links_is_that_of_the_scene() -> None:
    """The evidence of each stretch is relative to it."""
    arm = plain_ur5e()
    localizer = Localizer(Scene(robot=arm, base_wrench=None, link_prior="equal"))
    smoother = TorqueSmoother(localizer, build_model(arm))
    np.testing.assert_allclose(smoother._prior, 1.0 / 7.0, atol=1e-12)
