"""Several contacts with `Localizer.locate`: invariants and degenerate cases."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

import numpy as np
import pytest

from contactsense import (
    JointTorqueSensor,
    Localizer,
    Scene,
    WrenchSensor,
    static_localizer,
)
from contactsense.benchmarks.multi_contact.measure import match
from contactsense.benchmarks.multi_contact.trials import Push, Trial, Trials
from contactsense.multi_contact.contact_set_builder import NOT_EXPLAINED
from contactsense.multi_contact.locator import SEVERAL_CONTACTS
from tests.contactsense.multi_contact.measured_trials import locate, single_contact, trial_and_contact
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

ARM = plain_ur5e()
PRECISE = Scene(
    robot=ARM,
    base_wrench=WrenchSensor(force_noise=0.02, moment_noise=0.004),
    joint_torque=JointTorqueSensor(noise=0.02),
    surface_error=5e-4,
)


@pytest.fixture(scope="module")
def precise() -> Localizer:
    return Localizer(PRECISE)


def test_the_compilation_for_several_contacts_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """A localizer for one contact compiles that search when it is first asked for."""
    shown: list[tuple[object, ...]] = []

    def record(kernels: tuple[object, ...], _: object) -> AbstractContextManager[None]:
        shown.append(kernels)
        return nullcontext()

    localizer = Localizer(PRECISE)
    monkeypatch.setattr(static_localizer, "loaded", lambda kernel: False)
    monkeypatch.setattr(static_localizer, "shown_compilation", record)
    trial, _ = trial_and_contact(localizer)
    assert not shown
    locate(localizer, trial, trial.pushes, contacts=2)
    assert shown == [SEVERAL_CONTACTS]


def test_a_second_contact_is_found_beside_a_known_one(precise: Localizer) -> None:
    trials, errors = Trials(PRECISE, seed=1), []
    for _ in range(25):
        trial = trials.draw(2, 20.0, "different")
        known = single_contact(precise, trial, trial.pushes[0])
        both = locate(precise, trial, trial.pushes, contacts=2, known=(known,), drift=0.1)
        assert both.status == "multiple"
        assert both.explanations[0].contacts == both.contacts
        assert len(both.contacts) == 2
        errors.append(match(both.contacts, [push.point for push in trial.pushes]).max())
    # The line of action may intersect the arm twice, which the sensors cannot distinguish.
    assert np.median(errors) < 1e-3
    assert np.mean(np.array(errors) < 0.0225) >= 0.9


def test_a_known_force_has_the_noise_of_the_sensor() -> None:
    """The base sensor that measured a known contact was wrong by two standard deviations of its noise on each
    axis, so the force is too, and with it the place. Then there is nothing else to explain, however little
    forces have changed since."""
    noisy = Localizer(
        Scene(
            robot=ARM,
            base_wrench=WrenchSensor(force_noise=1.0, moment_noise=0.2),
            joint_torque=JointTorqueSensor(noise=1.0),
        )
    )
    trials, drift = Trials(noisy.scene, seed=3), 0.1
    for _ in range(10):
        trial = trials.draw(1, 20.0, "different")
        base, torque = trial.measure(trial.pushes)
        base[:3] += 2.0
        known = noisy.locate(trial.q, base_wrench=base, joint_torque=torque).contacts[0]
        assert np.linalg.norm(known.force_base - trial.pushes[0].force) > 5.0 * drift
        found = locate(noisy, trial, trial.pushes, contacts=2, known=[known], drift=drift)
        assert len(found.contacts) == 1


def test_a_third_contact_is_found_beside_two_known_ones(precise: Localizer) -> None:
    trials, errors = Trials(PRECISE, seed=2), []
    for _ in range(15):
        trial = trials.draw(3, 20.0, "different")
        known = tuple(single_contact(precise, trial, push) for push in trial.pushes[:2])
        every = locate(precise, trial, trial.pushes, contacts=3, known=known, drift=0.1)
        assert every.status == "multiple"
        errors.append(match(every.contacts, [push.point for push in trial.pushes]).max())
    assert np.median(errors) < 1e-3


def test_the_order_of_known_contacts_does_not_matter(precise: Localizer) -> None:
    trials = Trials(PRECISE, seed=3)
    for _ in range(5):
        trial = trials.draw(3, 20.0, "different")
        known = tuple(single_contact(precise, trial, push) for push in trial.pushes[:2])
        one = locate(precise, trial, trial.pushes, contacts=3, known=known)
        other = locate(precise, trial, trial.pushes, contacts=3, known=known[::-1])
        assert len(one.contacts) == len(other.contacts)
        assert match(one.contacts, [contact.point_base for contact in other.contacts]).max() < 2e-3
        assert one.explanations[0].probability == pytest.approx(other.explanations[0].probability, abs=0.05)


def test_beside_three_known_contacts_no_further_one_is_searched(precise: Localizer) -> None:
    """What is searched with has no room for more: a search wrote beyond its arrays."""
    trials = Trials(PRECISE, seed=5)
    for _ in range(5):
        trial = trials.draw(3, 20.0, "different")
        known = tuple(single_contact(precise, trial, push) for push in trial.pushes)
        locate(precise, trial, trial.pushes, contacts=3, known=known[:2])
        search = precise._locator
        assert search is not None
        columns = search.buffers.seeding.known_jacobian.copy()
        assert columns.any()
        found = locate(precise, trial, trial.pushes, contacts=3, known=known)
        assert len(found.contacts) == 3
        np.testing.assert_array_equal(search.buffers.seeding.known_jacobian, columns)


def test_one_contact_is_explained_as_one(ordinary: Localizer) -> None:
    trials = Trials(ordinary.scene, seed=4)
    counts = []
    for _ in range(60):
        trial = trials.draw(1, 20.0, "different")
        up_to_three = locate(ordinary, trial, trial.pushes, contacts=3)
        counts.append(1 if up_to_three.status != "multiple" else len(up_to_three.contacts))
        if up_to_three.status != "multiple":
            one = locate(ordinary, trial, trial.pushes)
            assert one.status == up_to_three.status
            assert one.contacts[0].probability == up_to_three.contacts[0].probability
    assert np.mean(np.array(counts) == 1) > 0.95


def test_a_known_contact_that_stays_alone_is_one_contact(ordinary: Localizer) -> None:
    trials = Trials(ordinary.scene, seed=5)
    for _ in range(20):
        trial = trials.draw(1, 20.0, "different")
        known = single_contact(ordinary, trial, trial.pushes[0])
        pushed = trials.changed(trial.pushes[0], None)
        again = locate(ordinary, trial, (pushed,), contacts=2, known=(known,))
        assert again.status in ("contact", "ambiguous")
        assert again.contacts[0].link == known.link
        # Two samples give more information than one.
        assert np.trace(again.contacts[0].covariance) <= np.trace(known.covariance) + 1e-9


def test_probabilities_add_up_to_one(ordinary: Localizer) -> None:
    trials = Trials(ordinary.scene, seed=6)
    for _ in range(15):
        trial = trials.draw(2, 30.0, "different")
        both = locate(ordinary, trial, trial.pushes, contacts=2)
        if both.status != "multiple":
            continue
        p = [explanation.probability for explanation in both.explanations]
        assert p[1:] == sorted(p[1:], reverse=True)
        assert sum(p) + both.other == pytest.approx(1.0)
        for contact in both.contacts:
            assert p[0] - 1e-12 <= contact.probability <= 1.0 + 1e-12
            assert contact.force_base @ contact.normal_base < 0.0
            assert np.linalg.eigvalsh(contact.covariance).min() > -1e-12
        assert (both.link_probability <= 1.0 + 1e-12).all()
        assert both.link_probability.max() >= p[0] - 1e-12
        np.testing.assert_allclose(
            both.wrench[:3], np.sum([contact.force_base for contact in both.contacts], axis=0), atol=1e-9
        )
        assert np.linalg.eigvalsh(both.covariance).min() > -1e-9


def test_the_estimate_is_equivariant_under_rotation_about_the_base_axis(precise: Localizer) -> None:
    trials = Trials(PRECISE, seed=7)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    compared = 0
    while compared < 5:
        trial = trials.draw(2, 20.0, "different")
        if any(push.link == 0 for push in trial.pushes):
            continue  # the base does not turn with the first joint
        compared += 1
        known = single_contact(precise, trial, trial.pushes[0])
        turned = replace(
            known,
            point_base=turn @ known.point_base,
            normal_base=turn @ known.normal_base,
            force_base=turn @ known.force_base,
            covariance=turn @ known.covariance @ turn.T,
        )
        base, torque = trial.measure(trial.pushes)
        a = precise.locate(
            trial.q, base_wrench=base, joint_torque=torque, contacts=2, known=[known], drift=0.1
        )
        b = precise.locate(
            trial.q + np.array([0.7, 0, 0, 0, 0, 0]),
            base_wrench=np.concatenate((turn @ base[:3], turn @ base[3:])),
            joint_torque=torque,
            contacts=2,
            known=[turned],
            drift=0.1,
        )
        assert match(b.contacts, [turn @ contact.point_base for contact in a.contacts]).max() < 1e-3


def test_two_contacts_on_one_link_are_reported_as_a_sum(precise: Localizer) -> None:
    trials = Trials(PRECISE, seed=8)
    for _ in range(5):
        trial = trials.draw(2, 20.0, "same")
        known = single_contact(precise, trial, trial.pushes[0])
        both = locate(precise, trial, trial.pushes, contacts=2, known=[known], drift=0.1)
        if both.status == "multiple" and len({contact.link for contact in both.contacts}) == 1:
            assert "the sum only" in both.reason
            assert "cannot be resolved" in both.reason
            break
    else:
        pytest.fail("no pair on one link was answered as one")


def test_unresolved_unknowns_of_adjacent_links_are_reported(ordinary: Localizer) -> None:
    """Adjacent links: seven measurements for ten unknowns."""
    trials = Trials(ordinary.scene, seed=9)
    reported = 0
    for _ in range(40):
        trial = trials.draw(2, 30.0, "different")
        both = locate(ordinary, trial, trial.pushes, contacts=2)
        links = sorted(contact.link_index for contact in both.contacts)
        if both.status == "multiple" and links[1] - links[0] < 4:
            assert f"{6 + links[1] - links[0]} independent measurements for 10 unknowns" in both.reason
            reported += 1
    assert reported > 5


def _along_normal(push: Push) -> Push:
    """The push without a tangential force."""
    return replace(push, force=-float(np.linalg.norm(push.force)) * push.normal)


def _opposite(trial: Trial) -> tuple[Push, Push]:
    """Two pushes whose forces cancel: the second takes the first's force, reversed."""
    one, two = map(_along_normal, trial.pushes)
    return one, replace(two, force=-one.force)


def test_opposite_forces_that_cancel_are_detected(ordinary: Localizer) -> None:
    trials = Trials(ordinary.scene, seed=10)
    seen = 0
    for _ in range(200):
        trial = trials.draw(2, 30.0, "different")
        one, two = _opposite(trial)
        if two.force @ two.normal > -15.0:
            continue
        seen += 1
        estimate = locate(ordinary, trial, (one, two), contacts=2)
        assert estimate.status != "none"
        assert estimate.status == "multiple" or estimate.reason or estimate.contacts
        if seen == 5:
            break
    assert seen == 5


def test_two_pushes_at_one_point_are_one_contact(ordinary: Localizer) -> None:
    trial = Trials(ordinary.scene, seed=11).draw(1, 10.0, "different")
    push = _along_normal(trial.pushes[0])
    estimate = locate(ordinary, trial, (push, push), contacts=2)
    assert estimate.status in ("contact", "ambiguous")
    twice = locate(ordinary, trial, (replace(push, force=2.0 * push.force, torsion=2.0 * push.torsion),))
    np.testing.assert_allclose(estimate.contacts[0].force_base, twice.contacts[0].force_base, atol=1e-6)


def test_tiny_forces_are_not_detected(ordinary: Localizer) -> None:
    trial = Trials(ordinary.scene, seed=12).draw(3, 1e-3, "different")
    assert locate(ordinary, trial, trial.pushes, contacts=3).status == "none"


def test_a_released_known_contact_has_no_force(precise: Localizer) -> None:
    trial = Trials(PRECISE, seed=13).draw(2, 20.0, "different")
    known = [single_contact(precise, trial, push) for push in trial.pushes]
    remaining = locate(precise, trial, trial.pushes[:1], contacts=2, known=known)
    force = {contact.link: float(np.linalg.norm(contact.force_base)) for contact in remaining.contacts}
    assert force[known[1].link] < 2.0


@pytest.mark.parametrize("present", [("base_wrench",), ("joint_torque",)])
def test_any_subset_of_sensors_is_sufficient(ordinary: Localizer, present: tuple[str, ...]) -> None:
    trial = Trials(ordinary.scene, seed=14).draw(2, 40.0, "different")
    base, torque = trial.measure(trial.pushes)
    inputs = {
        name: value for name, value in (("base_wrench", base), ("joint_torque", torque)) if name in present
    }
    estimate = ordinary.locate(trial.q, contacts=3, **inputs)  # type: ignore[arg-type]
    assert estimate.contacts
    for contact in estimate.contacts:
        assert np.isfinite(contact.point_base).all()


@pytest.mark.parametrize(
    ("factor", "status", "reason"), [(1.0, "contact", ""), (-1.0, "ambiguous", NOT_EXPLAINED)]
)
@pytest.mark.parametrize("drift", [None, 1.0])
def test_a_known_contact_must_explain_the_measurement(
    ordinary: Localizer, factor: float, status: str, reason: str, drift: float | None
) -> None:
    """Not one that pulls at the same place."""
    trial, known = trial_and_contact(ordinary)
    base, torque = trial.measure(trial.pushes)
    found = ordinary.locate(
        trial.q, base_wrench=factor * base, joint_torque=factor * torque, known=[known], drift=drift
    )
    assert (found.status, found.reason) == (status, reason)
    assert [contact.link for contact in found.contacts] == [known.link]


def test_a_third_push_beside_two_contacts_is_told(ordinary: Localizer) -> None:
    trial = Trials(ordinary.scene, seed=15).draw(3, 20.0, "different")
    known = single_contact(ordinary, trial, trial.pushes[0])
    two, three = (
        locate(ordinary, trial, trial.pushes[:count], contacts=2, known=[known], drift=1.0)
        for count in (2, 3)
    )
    assert NOT_EXPLAINED not in two.reason
    assert NOT_EXPLAINED in three.reason
