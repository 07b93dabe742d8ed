"""The bench of several contacts: pairing, constructed truth, the command's numbers."""

import numpy as np
import pytest

from contactsense import Contact, JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.benchmarks.multi_contact.measure import match, summary
from contactsense.benchmarks.multi_contact.stream import FIRST, SECOND, measure_stream, samples
from contactsense.benchmarks.multi_contact.trials import MIN_SEPARATION, Trials
from contactsense.benchmarks.static_truth.cases import Noise
from tests.plain_arm import plain_ur5e

pytestmark = pytest.mark.slow  # its kernels compile for long

SCENE = Scene(robot=plain_ur5e())


def _contact(x: float) -> Contact:
    zero = np.zeros(3)
    return Contact("forearm", 3, 0, 1.0, zero, np.array([x, 0.0, 0.0]), zero, zero, 0.0, np.eye(3))


def _points(*xs: float) -> list[np.ndarray]:
    return [np.array([x, 0.0, 0.0]) for x in xs]


def test_contacts_are_paired_with_the_nearest_truth() -> None:
    np.testing.assert_allclose(match([_contact(1.0), _contact(0.1)], _points(0.0, 1.2)), [0.1, 0.2])


def test_a_missed_contact_is_infinitely_far() -> None:
    np.testing.assert_allclose(match([_contact(0.9)], _points(0.0, 1.0)), [np.inf, 0.1])
    assert np.isinf(match([], _points(0.0))).all()


def test_one_contact_too_many_is_a_failure() -> None:
    assert np.isinf(match([_contact(0.0), _contact(0.5)], _points(0.0))).all()


def test_summary_counts_contacts_and_trials() -> None:
    row = summary([np.array([0.001, 0.002]), np.array([0.003, np.inf])], [0.001, 0.003], 2)
    assert row["success"] == 0.75
    assert row["all"] == 0.5
    assert row["counted"] == 0.5
    assert row["rmse_mm"] == pytest.approx(np.sqrt((1 + 4 + 9) / 3))
    assert row["median_ms"] == pytest.approx(2.0)


@pytest.mark.parametrize("links", ["different", "same"])
def test_trials_push_where_they_are_told(links: str) -> None:
    trials = Trials(SCENE, seed=1)
    for _ in range(10):
        trial = trials.draw(2, 20.0, links)  # type: ignore[arg-type]
        one, two = trial.pushes
        assert (one.link != two.link) == (links == "different")
        if links == "same":
            assert np.linalg.norm(one.point - two.point) >= MIN_SEPARATION
        for push in trial.pushes:
            assert np.linalg.norm(push.force) == pytest.approx(20.0)
            push_in = -push.force @ push.normal
            # Within the friction cone.
            assert push_in >= 20.0 / np.sqrt(1.0 + SCENE.friction**2) - 1e-9
        base, torque = trial.measure(trial.pushes)
        np.testing.assert_allclose(base, one.wrench + two.wrench)
        for j in range(6):
            seen = sum((push.wrench for push in trial.pushes if push.link > j), np.zeros(6))
            assert torque[j] == pytest.approx(-trial.screw[j] @ seen)


def test_a_force_that_changes_stays_in_the_friction_cone() -> None:
    trials = Trials(SCENE, seed=3)
    push = trials.draw(1, 20.0, "different").pushes[0]
    changed = np.array([trials.changed(push, 10.0).force for _ in range(200)])
    normal_force = -changed @ push.normal
    across = np.linalg.norm(changed + normal_force[:, None] * push.normal, axis=1)
    assert (across <= SCENE.friction * normal_force).all()
    assert np.std(normal_force) > 5.0
    near = np.array([trials.changed(push, 0.01).force for _ in range(200)])
    np.testing.assert_allclose(near, np.broadcast_to(push.force, near.shape), atol=0.05)


QUIET = Scene(
    robot=plain_ur5e(),
    base_wrench=WrenchSensor(force_noise=0.05, moment_noise=0.01),
    joint_torque=JointTorqueSensor(noise=0.3),
    contacts=2,
)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(QUIET)


def test_the_second_contact_of_a_stream_comes_and_goes(localizer: Localizer) -> None:
    """What the sensors say, summed over the pushes: their places shift the moment, and nothing else does."""
    trial = Trials(QUIET, seed=2).draw(2, 20.0, "different")
    still = [(s, p) for s, p in samples(localizer, trial, Noise(0.0, 0.0, 0.0), 0.0, 0)]
    weight = still[0][0].base_wrench
    for sample, points in still:
        on = [sum(start <= sample.t < stop for start, stop in (FIRST, SECOND))]
        assert [len(points)] == on
    full = min(still, key=lambda item: abs(item[0].t - 1.55))[0]
    swing = 1.0 + 0.4 * np.sin(2.0 * np.pi * (full.t - FIRST[0]))
    one, two = trial.pushes
    np.testing.assert_allclose(full.base_wrench - weight, swing * one.wrench + two.wrench, atol=1e-9)


def test_streams_are_judged(localizer: Localizer) -> None:
    row = measure_stream(localizer, Noise(0.05, 0.01, 0.3), 4, 0.5)
    assert row["streams"] == 4
    assert row["found"] >= 0.5
    assert row["false"] <= 0.25
    assert row["delay_ms"] < 100.0
