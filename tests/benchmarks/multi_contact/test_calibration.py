"""Calibration of several contacts: answers that are drawn from what they state are calibrated."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Contact, Explanation
from contactsense.benchmarks.multi_contact.calibration import calibration_several
from contactsense.benchmarks.multi_contact.calibration_summary import summarize
from contactsense.benchmarks.multi_contact.calibration_verdict import Verdict, verdict
from contactsense.benchmarks.multi_contact.measure import localizer_for
from contactsense.benchmarks.static_truth.cases import Noise

pytestmark = pytest.mark.slow  # its kernels compile for long

SPREAD = 0.004
NORMAL = np.array([0.0, 0.0, 1.0])


def _contact(link: int, x: float) -> Contact:
    zero = np.zeros(3)
    covariance = np.diag([SPREAD**2, SPREAD**2, 1e-8])
    return Contact("link", link, 0, 1.0, zero, np.array([x, 0.0, 0.0]), NORMAL, -NORMAL, 0.0, covariance)


SETS = (
    Explanation((_contact(2, 0.0), _contact(4, 0.5)), 0.7),
    Explanation((_contact(2, 0.0), _contact(5, 0.8)), 0.3),
)


def _drawn(seed: int) -> Verdict:
    """Verdict on a truth that is drawn from the explanations, its contacts in any order."""
    rng = np.random.default_rng(seed)
    true = SETS[0] if rng.random() < SETS[0].probability else SETS[1]
    order = rng.permutation(2)
    links = np.array([contact.link_index for contact in true.contacts])[order]
    noise = SPREAD * rng.standard_normal((2, 3)) * (1.0, 1.0, 0.0)
    points = (np.array([contact.point_base for contact in true.contacts]) + noise)[order]
    return verdict(SETS, links, points, False)


def test_truths_that_are_drawn_as_stated_are_calibrated() -> None:
    found = summarize("arm", Noise(0.0, 0.0, 0.0), 2, "at once", [_drawn(seed) for seed in range(300)])
    assert found.answer.error < found.answer.by_chance_95
    assert found.last.low < 0.9 < found.last.high
    assert found.counted == 1.0


def test_a_wrong_link_or_a_far_place_is_wrong() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert verdict(SETS, np.array([2, 4]), points, True).answer[1]
    assert not verdict(SETS, np.array([2, 3]), points, True).answer[1]
    far = points + np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    assert not verdict(SETS, np.array([2, 4]), far, True).answer[1]
    assert verdict(SETS, np.array([2, 4]), far, True).in_region == (True, False)


def test_the_nearest_explanation_is_the_true_one() -> None:
    near = Explanation((replace(SETS[0].contacts[0]), _contact(4, 0.51)), 0.2)
    points = np.array([[0.0, 0.0, 0.0], [0.509, 0.0, 0.0]])
    assert not verdict((SETS[0], near), np.array([2, 4]), points, True).answer[1]
    assert verdict((near, SETS[0]), np.array([2, 4]), points, True).answer[1]


def test_sensors_and_the_change_of_held_forces_can_be_chosen() -> None:
    scene = localizer_for("ur5e", Noise(0.05, 0.01, 0.3), sensors="torques").scene
    assert scene.base_wrench is None
    assert scene.joint_torque is not None
    arguments = ["--robot", "ur5e", "--trials", "10", "--arriving", "forces held", "--json"]
    results = [
        json.loads(CliRunner().invoke(calibration_several, [*arguments, *more]).stdout)
        for more in ((), ("--sensors", "torques"), ("--drift", "10"))
    ]
    for rows in results:
        assert [row["noise"]["torque"] for row in rows] == [0.0, 0.3, 1.0, 3.0]
        assert all(row["earlier"] is not None for row in rows[:3])
    everything, torques, changed = ([row["median_mm"] for row in rows[:3]] for rows in results)
    assert sum(torques) > 2.0 * sum(everything)
    assert changed != everything
