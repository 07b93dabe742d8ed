"""A sliding contact is told where it is, not where the observer and its means saw it last."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor, robots
from contactsense.benchmarks.accuracy.static_cases import COLUMNS
from contactsense.benchmarks.hold.simulate import SLIDE, Finger, stream

NOISE = COLUMNS[1]


@pytest.fixture(scope="module")
def way() -> np.ndarray:
    """Time since the touch [s], and by how much the place found is behind the finger [m], one row a sample of
    the slide from when it is said to be one; shape (N, 2)."""
    scene = Scene(
        robot=robots.load("ur5e"),
        base_wrench=WrenchSensor(force_noise=NOISE.force, moment_noise=NOISE.moment),
        joint_torque=JointTorqueSensor(noise=NOISE.torque),
    )
    localizer, finger = Localizer(scene), Finger()
    start, rows = finger.at(0.0)[0][0], []
    for sample, _, since in stream(SLIDE, finger, 1.5, 0, noise=NOISE):
        estimate = localizer.step(sample)
        if since > 0.6 and estimate.contacts and estimate.contacts[0].phase == "slide":
            rows.append((since, SLIDE.slide * (since - 0.5) - (start - estimate.contacts[0].point[0])))
    return np.array(rows)


def test_a_sliding_contact_has_no_lag(way: np.ndarray) -> None:
    """At 50 mm/s the observer alone is 0.8 mm behind, and a mean over two of its time constants more."""
    assert len(way) > 400
    assert abs(np.median(way[:, 1])) < 2e-4
    assert np.quantile(np.abs(way[:, 1]), 0.9) < 1.5e-3
