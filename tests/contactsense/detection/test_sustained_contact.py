"""Joint torques alone: a weak contact that lasts is found by the average of the residuals, and a strong one
ends as soon as its samples show."""

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock, Scene
from contactsense.tracking.contact_track import NONE
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

DT, BEGINS, ENDS, LENGTH = 0.002, 1.0, 2.0, 3.0
"""Sample time, when a push begins and ends, end of the stream [s]."""
Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
WEAK, STRONG = 0.9, 30.0
"""Torque of a push on the first two joints [Nm]: 3.6 and 120 standard deviations of a residual."""
T = np.arange(0.0, LENGTH, DT)
PUSH = np.clip(np.minimum(T - BEGINS, ENDS - T) / 0.02, 0.0, 1.0)
"""It begins and ends within 20 ms."""


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(Scene(robot=plain_ur5e(), base_wrench=None))


def touched(localizer: Localizer, push: np.ndarray, seed: int) -> np.ndarray:
    """Which samples of a stream touch; `push`: torque of a push in each [Nm]."""
    measured = weight(localizer.scene, Q)[0] + np.random.default_rng(seed).standard_normal((len(T), 6))
    measured[:, :2] -= np.sqrt(0.5) * push[:, None]
    still = np.zeros((len(T), 6))
    localizer.reset()
    (found,) = localizer.run_blocks([SampleBlock(T, np.tile(Q, (len(T), 1)), still, measured, None)])
    return np.asarray(found.phase != NONE)


@pytest.mark.slow
def test_the_average_shows_a_weak_contact_that_no_sample_shows(localizer: Localizer) -> None:
    thresholds = localizer._buffers.constants.thresholds
    detected = []
    for with_average in (True, False):
        kept = thresholds[:, :, 2].copy()
        if not with_average:
            thresholds[:, :, 2] = np.inf
        found = [touched(localizer, WEAK * PUSH, seed) for seed in range(20)]
        thresholds[:, :, 2] = kept
        assert not any(row[T < BEGINS].any() for row in found)
        assert not any(row[T > ENDS + 0.4].any() for row in found)
        detected.append(np.mean([row[(T > BEGINS + 0.4) & (T < ENDS)] for row in found]))
    assert detected[0] > 0.9
    assert detected[1] < 0.4


@pytest.mark.slow
def test_a_strong_contact_ends_as_soon_as_its_samples_show(localizer: Localizer) -> None:
    for seed in range(20):
        found = touched(localizer, STRONG * PUSH, seed)
        assert found[(T > BEGINS + 0.02) & (T < ENDS)].all()
        # Its residuals fall to 4 of 120 standard deviations within 3.4 time constants of 16 ms.
        assert not found[T > ENDS + 0.1].any()


@pytest.mark.slow
def test_a_contact_that_becomes_weak_is_found_again(localizer: Localizer) -> None:
    push = PUSH * np.where(T < BEGINS + 0.3, STRONG, WEAK)
    found = [touched(localizer, push, seed) for seed in range(20)]
    assert np.mean([row[(T > BEGINS + 0.7) & (T < ENDS)] for row in found]) > 0.9
    assert not any(row[T > ENDS + 0.4].any() for row in found)


def test_what_is_weak_soon_after_a_strong_contact_is_no_contact(localizer: Localizer) -> None:
    """The arm rings after a knock. Without one before it, the same torque is a contact; sometimes a sample
    shows it."""
    knock, found = T < BEGINS + 0.3, []
    swing = np.where(T < BEGINS + 0.5, -WEAK, 0.0)
    for seed in range(20):
        after_knock = touched(localizer, PUSH * np.where(knock, STRONG, swing), seed)
        alone = touched(localizer, np.where(knock, 0.0, swing), seed)
        found.append((after_knock[T > BEGINS + 0.4].any(), alone[~knock].any()))
    ringing, weak = np.mean(found, axis=0)
    assert ringing < 0.1
    assert weak > 0.9


@pytest.mark.slow
def test_both_tests_together_give_no_more_false_alarms_than_stated() -> None:
    """400 an hour over an hour; the law for the average is that of a process with one time constant."""
    per_hour, runs = 400.0, 1200
    localizer = Localizer(Scene(robot=plain_ur5e(), base_wrench=None, false_alarms_per_hour=per_hour))
    thresholds, counts = localizer._buffers.constants.thresholds, []
    for average in (thresholds[:, :, 2].copy(), np.inf):
        thresholds[:, :, 2] = average
        found = [touched(localizer, 0.0 * T, seed) for seed in range(runs)]
        counts.append(sum(int(np.count_nonzero(np.diff(row.astype(int)) > 0)) for row in found))
    stated = per_hour * runs * LENGTH / 3600.0
    assert 0.4 * stated < counts[1] < counts[0] < 1.1 * stated
