"""Without a base sensor, a push that changes its magnitude is averaged, and its present force is reported."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, forward_model
from contactsense.residuals.observers import first_torque
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.tracking.contact_track import WINDOWS, ContactTrack
from contactsense.tracking.torque_windows import present_magnitude, torque_difference
from tests.plain_arm import plain_ur5e

VARIANCE = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
"""Of each torque's noise in one sample [Nm^2]."""
STEP, ONSET, SETTLED, END = 0.002, 300, 800, 1600
"""Time between samples [s], and numbers of samples: of the onset, from which on the contact is old, and of
all."""
Q = np.array([0.3, -1.2, 1.4, -1.0, -1.5, 0.4])
NOISE = 0.2
"""Of a torque [Nm]."""


def windows(torque: np.ndarray, ratio: np.ndarray) -> ContactTrack:
    """Windows with these mean torques, shape (W, 6) [Nm], and variances in units of that of one sample."""
    track = zeros(ContactTrack, joints=6, links=7, link_sensors=0)
    first = first_torque(6)
    for i in range(len(torque)):
        track.mean[i, first : first + 6] = torque[i]
        track.windows[i].variance_ratio = ratio[i]
    return track


@pytest.mark.parametrize("scale", [1.0, 1.7])
def test_differences_are_chi_square_variables(scale: float) -> None:
    """Of n degrees of freedom as long as nothing changes, of n - 1 also if the magnitude does."""
    chance = np.random.default_rng(0)
    torque, ratio, whole, direction = (
        np.array([9.0, -20.0, 14.0, 3.0, -2.0, 1.0]),
        np.array([0.06, 1e-9]),
        [],
        [],
    )
    for magnitude in (1.0, 0.6):
        for _ in range(4000):
            newest = magnitude * torque + np.sqrt(scale * VARIANCE * ratio[0]) * chance.standard_normal(6)
            found = torque_difference((VARIANCE, scale), windows(np.array([newest, torque]), ratio), 1, 0)
            whole.append(found.whole)
            direction.append(found.direction)
    assert np.mean(whole[:4000]) == pytest.approx(6.0, rel=0.03)
    assert np.mean(whole[4000:]) > 100.0
    assert np.mean(direction[:4000]) == pytest.approx(5.0, rel=0.03)
    assert np.mean(direction[4000:]) == pytest.approx(5.0, rel=0.03)
    assert np.var(direction) == pytest.approx(10.0, rel=0.1)


def test_windows_without_torques_agree() -> None:
    nothing = windows(np.zeros((2, 6)), np.array([0.06, 0.01]))
    assert torque_difference((VARIANCE, 1.0), nothing, 1, 0) == (0.0, 0.0)
    assert present_magnitude(VARIANCE, nothing, 1, 0) == 1.0


def test_no_push_becomes_a_pull() -> None:
    """Torques of the opposite sign are those of another contact, as after a rebound."""
    torque = np.array([9.0, -20.0, 14.0, 3.0, -2.0, 1.0])
    track = windows(np.array([-0.5 * torque, torque]), np.array([0.06, 0.01]))
    assert present_magnitude(VARIANCE, track, 1, 0) == 0.0
    found = torque_difference((VARIANCE, 1.0), track, 1, 0)
    assert found.direction == pytest.approx(np.sum(0.25 * torque**2 / (0.06 * VARIANCE)))
    assert found.whole == pytest.approx(9.0 * found.direction)


def test_a_trembling_push_is_averaged_for_as_long_as_it_lasts() -> None:
    """By a third of its force, at 0.7 Hz."""
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(noise=NOISE))
    place, push = np.array([-0.2, 0.0, 0.047]), np.array([5.0, 10.0, -30.0])
    free = forward_model(scene, Q, "forearm", place, np.zeros(3)).joint_torque
    loaded = forward_model(scene, Q, "forearm", place, push).joint_torque - free
    localizer, chance, used = Localizer(scene), np.random.default_rng(0), []
    size: list[float] = []
    wrench: list[float] = []
    true: list[float] = []
    for i in range(END):
        now = 0.0 if i < ONSET else 1.0 + 0.33 * np.sin(2.0 * np.pi * 0.7 * (i - ONSET) * STEP)
        torque = free + now * loaded + NOISE * chance.standard_normal(6)
        estimate = localizer.step(Sample(i * STEP, Q, np.zeros(6), torque))
        if i >= SETTLED:
            used.append(int(localizer._buffers.state.track.status[0].window))
            size.append(float(np.linalg.norm(estimate.contacts[0].force_base)))
            wrench.append(float(np.linalg.norm(estimate.wrench)))
            true.append(now)
    assert np.mean(np.array(used) == WINDOWS - 1) > 0.95
    for found in (size, wrench):
        assert np.corrcoef(found, true)[0, 1] > 0.95
        slope = np.polyfit(true, found, 1)[0] / np.mean(found)
        assert slope == pytest.approx(1.0, abs=0.15)
