"""Smoothing without a base sensor: one direction of the torques in a stretch, evidence over all stretches."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock, Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.runtime.result_rows import LINK, TORSION
from contactsense.service.analysis.samples.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.samples.contact_windows import contact_windows
from contactsense.service.analysis.smoothing.contact_smoothing import ContactSmoother
from contactsense.service.analysis.smoothing.place_search import Place
from contactsense.service.analysis.smoothing.smoothed_contact import SmoothedContact, ranked
from contactsense.service.analysis.smoothing.torque_smoothing import (
    TorqueSmoother,
    _Candidate,
    _followed,
    _magnitudes,
)
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, Touch, simulate
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


def _first(history: ContactHistory, count: int) -> ContactHistory:
    """The first samples of a contact."""
    explained = history.sample < count
    return replace(
        history,
        row=history.row[:count], block=history.block[:count], phase=history.phase[:count],
        energy=history.energy[:count], base_wrench=history.base_wrench[:count],
        base_wrench_std=history.base_wrench_std[:count], joint_torque=history.joint_torque[:count],
        joint_torque_std=history.joint_torque_std[:count], sample=history.sample[explained],
        rows=history.rows[explained], link_probability=history.link_probability[explained],
    )  # fmt: skip


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


def test_the_forces_belong_to_the_stated_link_and_push_there(
    contacts: Sequence[tuple[ContactHistory, Touch]],
) -> None:
    smoother, summarizer, forces_live, forces, true = ContactSmoother(SCENE), Summarizer(SCENE), [], [], []
    for history, touch in contacts:
        found = smoother.smooth(history)
        if found is None:
            continue
        at_place = smoother.with_forces(history, found)
        contact = summarizer.with_place(summarizer.summarize(history, "demo"), at_place, found)
        assert contact.force_base @ contact.normal_base < 0.0
        assert contact.peak_force == pytest.approx(np.linalg.norm(contact.force_base))
        assert set(at_place.rows[:, LINK]) == {contact.link_index}
        forces_live.append(history.force.max())
        forces.append(contact.peak_force)
        true.append(np.linalg.norm(touch.force_base, axis=1).max())
    assert len(true) >= 4
    off_live, off = (np.abs(np.log(np.array(values) / true)).mean() for values in (forces_live, forces))
    assert off < off_live


def test_the_torques_of_six_joints_give_the_force_itself(
    contacts: Sequence[tuple[ContactHistory, Touch]],
) -> None:
    """A contact on the last link at a known place: link, force and torsion are exact."""
    arm, rng = plain_ur5e(), np.random.default_rng(8)
    smoother = ContactSmoother(Scene(robot=arm, base_wrench=None))
    model, motion = build_model(arm), empty_motion(6)
    history, _ = contacts[0]
    K = len(history.sample)
    point, normal = np.array([0.02, 0.03, -0.01]), np.array([0.6, 0.0, 0.8])
    push, torque = rng.uniform(5.0, 50.0, K), history.joint_torque.copy()
    for k, row in enumerate(history.sample):
        forward_kinematics(model, history.block.q[row], motion)
        c, n = motion.origin[6] + motion.rotation[6] @ point, motion.rotation[6] @ normal
        wrench = push[k] * np.concatenate((-n, np.cross(c, -n) + 1e-3 * n))
        torque[row] = motion.screw @ wrench
    windows = contact_windows(history, SCENE.bandwidth)
    assert windows is not None
    W = len(windows.t)
    place = Place(
        6, 0.0, np.tile(point, (W, 1)), np.tile(normal, (W, 1)), np.zeros((W, 3)), np.zeros((W, 3, 3)),
        point[None], 0.0, 0.0,
    )  # fmt: skip
    exact = replace(history, joint_torque=torque, joint_torque_std=np.full_like(torque, 1e-4))
    found = smoother.with_forces(exact, SmoothedContact(windows, (place,), np.ones(1), np.eye(7)[6]))
    np.testing.assert_allclose(found.force, push, rtol=1e-3)
    np.testing.assert_allclose(found.rows[:, TORSION], 1e-3 * push, rtol=1e-2)
    assert set(found.rows[:, LINK]) == {6.0}


def test_a_base_sensor_measures_the_force(contacts: Sequence[tuple[ContactHistory, Touch]]) -> None:
    history, _ = contacts[0]
    found = ContactSmoother(SCENE).smooth(history)
    assert found is not None
    assert ContactSmoother(Scene(robot="ur5e")).with_forces(history, found) is history


def test_a_links_places_share_its_probability(contacts: Sequence[tuple[ContactHistory, Touch]]) -> None:
    smoother, several = ContactSmoother(SCENE), 0
    for history, _ in contacts:
        found = smoother.smooth(history)
        if found is None:
            continue
        links = np.array([place.link for place in found.places])
        shares = np.bincount(links, found.probability, minlength=len(found.link_probability))
        np.testing.assert_allclose(shares, found.link_probability, atol=1e-12)
        assert found.probability[0] == found.probability.max()
        several += len(links) > len(set(links))
    assert several > 0


def test_four_stretches_count_as_two_independent_ones(
    contacts: Sequence[tuple[ContactHistory, Touch]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One place and one push are behind all of them, and the surface's error is the same."""
    smoother, chosen = ContactSmoother(SCENE)._torques, None
    for history, _ in contacts:
        windows = contact_windows(history, SCENE.bandwidth)
        assert windows is not None
        for one in smoother._stretches(history, windows) or []:
            best = int(np.argmax(smoother._prior * one.ratio))
            if len(one.on(best)) > 1:
                chosen = history, windows, one, best
    assert chosen is not None
    history, windows, one, best = chosen
    four = [replace(one, windows=slice(k, k + 1)) for k in range(4)]
    monkeypatch.setattr(smoother, "_stretches", lambda *_: four)
    found = smoother.smooth(history, windows)
    assert found is not None
    assert found.best.link == best
    there = np.unique([contact.link_index for contact in one.contacts])
    weight = (smoother._prior * one.ratio**2)[there]
    np.testing.assert_allclose(found.link_probability[there], weight / weight.sum(), rtol=1e-9)
    # Each place has the share of its candidate.
    on_link = [contact.probability for contact in one.on(best)]
    assert found.probability[0] == pytest.approx(
        found.link_probability[best] * max(on_link) / sum(on_link), rel=1e-9
    )


def test_what_acted_before_the_onset_counts(contacts: Sequence[tuple[ContactHistory, Touch]]) -> None:
    """An impact is over when it has been detected: all that is left is the residual, which decays."""
    smoother = ContactSmoother(SCENE)._torques
    history, touch = contacts[0]
    K = 2.0 * np.pi * SCENE.bandwidth
    since = history.t[:20] - history.t[0]
    impact = replace(
        _first(history, 20),
        joint_torque=history.joint_torque[40] * np.exp(-K * since)[:, None],
    )
    windows = contact_windows(impact, SCENE.bandwidth)
    assert windows is not None
    # The torque in the windows is zero.
    np.testing.assert_allclose(windows.joint_torque, 0.0, atol=0.05 * np.abs(history.joint_torque[40]).max())
    found = smoother.smooth(impact, windows)
    assert found is not None
    assert found.best.link == touch.link_index


def test_a_place_that_moves_by_more_than_its_errors_slides() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0]])

    def path(std: float) -> Place:
        return _followed(
            3, 0.0,
            [_Candidate(0.5, p, np.eye(3)[2], -np.eye(3)[2], std**2 * np.eye(3)) for p in points],
            np.array([0, 0, 1, 2, 2]),
        )  # fmt: skip

    assert not path(0.02).sliding
    moving = path(0.001)
    assert moving.sliding
    np.testing.assert_allclose(moving.point, points[[0, 0, 1, 2, 2]])


def test_between_two_stretches_a_place_is_one_of_theirs(
    contacts: Sequence[tuple[ContactHistory, Touch]],
) -> None:
    """On either side of a thin link: half-way between them is inside of it, and has no normal."""
    windows = contact_windows(contacts[0][0], SCENE.bandwidth)
    assert windows is not None
    up = np.array([0.0, 0.0, 1.0])
    sides = [_Candidate(0.5, 0.03 * n, n, -n, 1e-4 * np.eye(3)) for n in (up, -up)]
    later = (np.arange(len(windows.t)) >= 3).astype(int)
    found = ranked(windows, [_followed(3, 0.0, sides, later)], 7, jumps=True)
    assert found is not None
    t = np.linspace(windows.t[0], windows.t[5], 101)
    point, normal, _ = found.at(t)
    np.testing.assert_array_equal(np.abs(point), np.broadcast_to(0.03 * up, point.shape))
    np.testing.assert_array_equal(0.03 * normal, point)
    assert len(np.unique(point[:, 2])) == 2
