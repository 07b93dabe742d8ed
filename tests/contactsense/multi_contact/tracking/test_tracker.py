"""Several contacts in a stream: onset, distinction from the first contact, release."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks.multi_contact.measure import match
from contactsense.multi_contact.tracking import further_contact_test
from contactsense.multi_contact.tracking.hypothesis_test import SEARCH_INTERVAL
from tests.contactsense.multi_contact.streams import Push, stream
from tests.plain_arm import plain_ur5e
from tests.shared import truth

pytestmark = pytest.mark.slow  # its kernels compile for long

NOISE = (0.05, 0.01, 0.3)
SCENE = Scene(
    robot=plain_ur5e(),
    base_wrench=WrenchSensor(force_noise=NOISE[0], moment_noise=NOISE[1]),
    joint_torque=JointTorqueSensor(noise=NOISE[2]),
    surface_error=1e-4,
    contacts=3,
)
FOREARM = Push(3, (-0.2, 0.04, 0.007), (1.0, -20.0, 0.0), 0.3, 1.6)
UPPER_ARM = Push(2, (-0.25, 0.0, 0.188), (1.0, 2.0, -18.0), 0.7, 1.2)
WRIST = Push(5, (0.0, 0.02, 0.045), (1.0, 1.0, -15.0), 0.7, 1.2)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def _run(
    localizer: Localizer, pushes: list[Push], seconds: float, seed: int = 0, speed: float = 0.0
) -> tuple[list[Estimate], list[list[np.ndarray]]]:
    localizer.reset()
    estimates, truth = [], []
    for sample, points in stream(SCENE, pushes, seconds, NOISE, seed, speed):
        estimates.append(localizer.step(sample))
        truth.append(points)
    return estimates, truth


def test_a_scene_with_one_contact_never_returns_several() -> None:
    single = Localizer(SCENE.model_copy(update={"contacts": 1}))
    estimates, _ = _run(single, [FOREARM, WRIST], 1.0)
    assert all(estimate.status != "multiple" and not estimate.explanations for estimate in estimates)


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("second", [UPPER_ARM, WRIST])
def test_onset_and_release_of_a_second_contact(localizer: Localizer, second: Push, speed: float) -> None:
    estimates, truth = _run(localizer, [FOREARM, second], 1.8, seed=3, speed=speed)
    errors = []
    for estimate, points in zip(estimates, truth, strict=True):
        if estimate.t < 0.69 or 1.3 < estimate.t < 1.55:
            assert estimate.status != "multiple"
        if 0.85 < estimate.t < 1.15:
            assert estimate.status == "multiple"
            assert {contact.id for contact in estimate.contacts} == {1, 2}
            assert sum(e.probability for e in estimate.explanations) == pytest.approx(1.0)
            errors.append(match(estimate.contacts, points))
    # The first is known to a fraction of a millimetre, the second less accurately.
    assert np.median(np.max(errors, axis=1)) < 0.0225
    events = [(event.kind, event.contact) for e in estimates for event in e.events]
    kinds = [(kind, number) for kind, number in events if kind in ("onset", "release")]
    assert kinds == [("onset", 1), ("onset", 2), ("release", 2), ("release", 1)]
    assert ("hold", 2) in events


@pytest.mark.parametrize("how", ["clock", "restart"])
def test_a_new_stream_releases_all_contacts(localizer: Localizer, how: str) -> None:
    localizer.reset()
    samples = [sample for sample, _ in stream(SCENE, [FOREARM, WRIST], 1.1, NOISE, 3, 0.0)]
    before = [localizer.step(sample) for sample in samples][-1]
    assert {contact.id for contact in before.contacts} == {1, 2}
    if how == "restart":
        localizer.restart("another controller")
    t = 0.5 if how == "clock" else samples[-1].t + 0.002
    after = [localizer.step(replace(sample, t=t + 0.002 * i)) for i, sample in enumerate(samples)]
    assert sorted((event.kind, event.contact) for event in after[0].events) == [
        ("release", 1),
        ("release", 2),
    ]
    told = "got an earlier one" if how == "clock" else "another controller"
    assert all(told in event.reason for event in after[0].events)
    assert {contact.id for contact in after[-1].contacts} == {3, 4}


def test_contacts_that_nothing_explains_any_more_are_released(
    localizer: Localizer, monkeypatch: pytest.MonkeyPatch
) -> None:
    localizer.reset()
    samples = [sample for sample, _ in stream(SCENE, [FOREARM, UPPER_ARM], 1.1, NOISE, 3, 0.0)]
    before = [localizer.step(sample) for sample in samples][-1]
    assert {contact.id for contact in before.contacts} == {1, 2}
    tracker = localizer._multi_tracker
    assert tracker is not None
    monkeypatch.setattr(tracker._filter, "evaluate", lambda present: [])
    after = localizer.step(replace(samples[-1], t=samples[-1].t + 0.002))
    assert after.status != "multiple"
    assert [(event.kind, event.contact) for event in after.events] == [("release", 2)]


def test_after_a_search_that_left_one_contact_the_next_test_keeps_its_time(
    localizer: Localizer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test takes as long as a search: both at once would make a sample late."""
    localizer.reset()
    samples = [sample for sample, _ in stream(SCENE, [FOREARM, UPPER_ARM], 1.1, NOISE, 3, 0.0)]
    for sample in samples:
        localizer.step(sample)
    tracker, begun = localizer._multi_tracker, []
    assert tracker is not None
    monkeypatch.setattr(further_contact_test, "candidate_hypotheses", lambda *_: begun.append(t) or [])
    monkeypatch.setattr(tracker._filter, "evaluate", lambda present: [])
    t = left = samples[-1].t + 1.0
    for _ in range(20):
        estimate, number, _ = tracker.step(t, (True, True, 0), 1, True, "")
        assert (estimate, number) == (None, 1)
        t += 0.002
    wait = SEARCH_INTERVAL / (2.0 * np.pi * SCENE.bandwidth)
    assert wait > 2 * 0.002
    assert begun
    assert begun[0] == pytest.approx(left + wait, abs=0.0021)
    assert begun[0] >= left + wait - 1e-9


def test_the_first_contact_can_be_released_first(localizer: Localizer) -> None:
    second = replace(WRIST, stop=1.8)
    estimates, truth = _run(localizer, [replace(FOREARM, stop=1.2), second], 2.0, seed=4)
    events = [(event.kind, event.contact) for e in estimates for event in e.events]
    kinds = [(kind, number) for kind, number in events if kind in ("onset", "release")]
    assert kinds == [("onset", 1), ("onset", 2), ("release", 1), ("release", 2)]
    late = [
        (e.contacts[0], points[0]) for e, points in zip(estimates, truth, strict=True) if 1.5 < e.t < 1.75
    ]
    assert {contact.id for contact, _ in late} == {2}
    assert np.median([np.linalg.norm(contact.point_base - point) for contact, point in late]) < 0.01


def test_all_contacts_can_be_released_at_once(localizer: Localizer) -> None:
    estimates, _ = _run(localizer, [FOREARM, replace(WRIST, stop=1.6)], 1.8, seed=5)
    released = {event.contact for e in estimates for event in e.events if event.kind == "release"}
    assert released == {1, 2}
    assert estimates[-1].status == "none"


def test_the_contact_that_is_left_may_resume(localizer: Localizer) -> None:
    """0.03 s after the second one has ended it begins again."""
    again = replace(WRIST, start=1.93, stop=2.2)
    estimates, _ = _run(localizer, [replace(FOREARM, stop=1.2), replace(WRIST, stop=1.8), again], 2.1, seed=4)
    events = [(event.kind, event.contact) for e in estimates for event in e.events]
    assert [event for event in events if event[0] not in ("hold", "slide")] == [
        ("onset", 1), ("onset", 2), ("release", 1), ("release", 2), ("resume", 2),
    ]  # fmt: skip
    assert {contact.id for contact in estimates[-1].contacts} == {2}


def test_of_several_contacts_that_end_at_once_none_resumes(localizer: Localizer) -> None:
    again = replace(FOREARM, start=1.72, stop=2.0)
    estimates, _ = _run(localizer, [FOREARM, replace(WRIST, stop=1.6), again], 1.8, seed=5)
    begun = [(e.kind, e.contact) for estimate in estimates for e in estimate.events]
    assert [event for event in begun if event[0] in ("onset", "resume")] == [
        ("onset", 1), ("onset", 2), ("onset", 3),
    ]  # fmt: skip


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_slide_or_a_force_change_is_not_a_second_contact(localizer: Localizer, speed: float) -> None:
    def slide(t: float) -> float:
        return 0.05 * float(np.clip(t - 0.7, 0.0, 0.6))

    def push(t: float) -> float:
        return float(np.interp(t, [0.7, 0.75, 1.0, 1.02], [0.5, 1.5, 1.5, 0.4]))

    for seed, changed in enumerate((replace(FOREARM, slide=slide), replace(FOREARM, size=push))):
        estimates, _ = _run(localizer, [changed], 1.5, seed, speed)
        assert all(estimate.status != "multiple" for estimate in estimates)


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_no_single_touch_of_the_meshes_is_two_contacts(robot: str) -> None:
    """Among them slides over edges, of which the primitives know nothing."""
    data, scale = truth(f"motion_{robot}.npz"), np.repeat(NOISE[:2], 3)
    measured = (
        data["q"],
        data["qd"].astype(float),
        data["tau"] + NOISE[2] * data["noise_tau"],
        data["base_wrench"] + scale * data["noise_wrench"],
    )
    localizer = Localizer(
        Scene(
            robot=robot,
            base_wrench=SCENE.base_wrench,
            joint_torque=SCENE.joint_torque,
            contacts=2,
        )
    )
    touched = 0
    for run in np.flatnonzero(~data["run_multi"]):
        localizer.reset()
        for i in np.flatnonzero(data["run"] == run):
            estimate = localizer.step(Sample(float(data["t"][i]), *(array[i] for array in measured)))
            touched += bool(estimate.contacts)
            assert estimate.status != "multiple", (run, estimate.t)
    assert touched > 3000


def test_missing_torques_degrade_the_estimate(localizer: Localizer) -> None:
    """The torques are lost while two contacts are on: the estimate is degraded and says so."""
    localizer.reset()
    status, reason = "", ""
    for sample, _ in stream(SCENE, [FOREARM, UPPER_ARM], 1.15, NOISE, 6, 0.0):
        received = replace(sample, joint_torque=None) if sample.t > 0.95 else sample
        estimate = localizer.step(received)
        status, reason = estimate.status, estimate.reason
        for contact in estimate.contacts:
            assert np.isfinite(contact.point_base).all()
    assert status == "degraded"
    assert "joint_torque is missing" in reason


def test_a_reset_forgets_all_contacts(localizer: Localizer) -> None:
    _run(localizer, [FOREARM, UPPER_ARM], 0.9, seed=7)
    estimates, _ = _run(localizer, [FOREARM], 0.7, seed=8)
    assert {contact.id for e in estimates for contact in e.contacts} == {1}
    assert all(estimate.status != "multiple" for estimate in estimates)
