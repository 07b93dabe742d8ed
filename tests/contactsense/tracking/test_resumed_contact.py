"""What is one contact and what are two, on constructed truth: an arm at rest, pushed and let go."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, SampleBlock, Scene, WrenchSensor
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
START = 0.3
"""When the first push begins [s]."""
SETTLING = 5.0 / (2.0 * np.pi * 10.0)
"""Settling time of the observers at the default bandwidth [s]."""


class Push(NamedTuple):
    """A push that rises and falls as a half sine."""

    begin: float
    """Time since `START` [s]."""
    length: float
    """[s]"""
    force: tuple[float, float, float]
    """At its height, axes of the link [N]."""
    link: int = 3
    point: tuple[float, float, float] = (-0.2, 0.04, 0.007)
    """Link frame [m]."""


KNOCK = Push(0.0, 0.04, (0.0, -80.0, 0.0))
"""The observers forget it 0.13 s after its begin."""
REBOUND = KNOCK._replace(begin=0.17, force=(0.0, 30.0, 0.0))
"""The arm swings back: its residuals are those of a weaker pull."""


def plain_scene(**others: object) -> Scene:
    return Scene.model_validate(
        {
            "robot": ARM,
            "base_wrench": WrenchSensor(force_noise=0.25, moment_noise=0.05),
            "joint_torque": JointTorqueSensor(noise=1.0),
            "surface_error": 1e-4,
            **others,
        }
    )


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(plain_scene())


def pushed_arm(pushes: Sequence[Push], seed: int = 0, seconds: float = 1.2) -> list[Sample]:
    """All samples of an arm at rest, 500 a second."""
    scene, model, motion = Scene(robot=ARM), build_model(ARM), empty_motion(6)
    torque, wrench, zero = np.empty(6), np.empty(6), np.zeros(6)
    inverse_dynamics(model, Q, zero, zero, scene.gravity_base, motion, torque, wrench)
    noise = np.random.default_rng(seed).standard_normal((round(seconds / 0.002), 12))
    noise[:, 6:] *= np.repeat([0.25, 0.05], 3)
    samples = []
    for i, n in enumerate(noise):
        felt_torque, felt_wrench = torque + n[:6], wrench + n[6:]
        for push in pushes:
            R, o = motion.rotation[push.link], motion.origin[push.link]
            part = (0.002 * i - START - push.begin) / push.length
            force = R @ push.force * np.sin(np.pi * np.clip(part, 0.0, 1.0))
            w = np.concatenate((force, np.cross(R @ push.point + o, force)))
            felt_torque[: push.link] -= motion.screw[: push.link] @ w
            felt_wrench += w
        samples.append(Sample(0.002 * i, Q, zero, felt_torque, felt_wrench))
    return samples


def _changes(estimates: Sequence[Estimate]) -> list[tuple[str, int]]:
    """Beginnings and ends."""
    return [
        (event.kind, event.contact)
        for estimate in estimates
        for event in estimate.events
        if event.kind in ("onset", "release", "resume")
    ]


ONE = [("onset", 1), ("release", 1)]
RESUMED = [*ONE, ("resume", 1), ("release", 1)]
TWO = [*ONE, ("onset", 2), ("release", 2)]


@pytest.mark.parametrize("seed", range(5))
def test_a_knock_and_its_rebound_have_one_number(localizer: Localizer, seed: int) -> None:
    estimates = list(localizer.run(pushed_arm((KNOCK, REBOUND), seed)))
    assert _changes(estimates) == RESUMED
    assert {contact.id for estimate in estimates for contact in estimate.contacts} == {1}


@pytest.mark.parametrize("seed", range(5))
def test_a_touch_that_is_lost_and_found_again_has_one_number(localizer: Localizer, seed: int) -> None:
    weak = Push(0.0, 0.1, (0.0, -12.0, 0.0))
    estimates = list(localizer.run(pushed_arm((weak, weak._replace(begin=0.2)), seed)))
    assert _changes(estimates) == RESUMED


@pytest.mark.parametrize("seed", range(5))
def test_a_double_tap_is_two_contacts(localizer: Localizer, seed: int) -> None:
    tap = Push(0.0, 0.1, (0.0, -30.0, 0.0))
    assert _changes(list(localizer.run(pushed_arm((tap, tap._replace(begin=0.3)), seed)))) == TWO


@pytest.mark.parametrize("seed", range(5))
def test_touches_of_different_links_are_two_contacts_even_after_a_short_pause(
    localizer: Localizer, seed: int
) -> None:
    upper_arm = Push(0.17, 0.04, (0.0, 0.0, -60.0), 2, (-0.2, 0.0, 0.19))
    estimates = list(localizer.run(pushed_arm((KNOCK, upper_arm), seed)))
    assert _changes(estimates) == TWO


def test_the_pause_may_be_as_long_as_the_observers_settle(localizer: Localizer) -> None:
    """A second knock later and later: after a longer pause it has a number of its own."""
    pauses: dict[str, list[float]] = {"resume": [], "onset": []}
    for begin in np.arange(0.15, 0.26, 0.01):
        estimates = localizer.run(pushed_arm((KNOCK, KNOCK._replace(begin=float(begin)))))
        _, release, again, *_ = (event for estimate in estimates for event in estimate.events)
        # It begins one sample before it is reported.
        pauses[again.kind].append(again.t - 0.002 - release.t)
    assert max(pauses["resume"]) < SETTLING < min(pauses["onset"]) < max(pauses["resume"]) + 0.02


def test_onset_and_release_are_reported_as_early_as_without_a_rebound(localizer: Localizer) -> None:
    for seed in range(3):
        first = [
            [(event.kind, event.t) for estimate in estimates for event in estimate.events][:2]
            for estimates in (localizer.run(pushed_arm(p, seed)) for p in ((KNOCK,), (KNOCK, REBOUND)))
        ]
        assert first[0] == first[1]


def test_blocks_number_contacts_as_single_samples_do(localizer: Localizer) -> None:
    samples = pushed_arm((KNOCK, REBOUND, KNOCK._replace(begin=0.5)))
    block = SampleBlock(
        *(
            np.array([getattr(s, name) for s in samples])
            for name in ("t", "q", "qd", "joint_torque", "base_wrench")
        )
    )
    (found,) = localizer.run_blocks([block])
    numbers = {int(i): int(found.number[i]) for i in np.flatnonzero(found.phase)}
    estimates = list(localizer.run(samples))
    assert numbers == {i: e.contacts[0].id for i, e in enumerate(estimates) if e.contacts}
    assert set(numbers.values()) == {1, 2}


def test_a_new_stream_resumes_nothing(localizer: Localizer) -> None:
    """The clock is set back in the pause between two knocks."""
    samples = pushed_arm((KNOCK, REBOUND))
    at = next(i for i, e in enumerate(localizer.run(samples)) if any(x.kind == "release" for x in e.events))
    late = [Sample(s.t - 0.1, s.q, s.qd, s.joint_torque, s.base_wrench) for s in samples[at + 1 :]]
    kinds = [kind for kind, _ in _changes(list(localizer.run([*samples[: at + 1], *late])))]
    assert "resume" not in kinds


@pytest.mark.slow
def test_a_contact_resumes_where_several_are_looked_for() -> None:
    assert _changes(list(Localizer(plain_scene(contacts=2)).run(pushed_arm((KNOCK, REBOUND))))) == RESUMED
