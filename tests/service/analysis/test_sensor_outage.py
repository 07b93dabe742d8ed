"""The base sensor is silent for a moment of a contact: force and place are those of the other moments."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock
from contactsense.service.analysis.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.smoothing import ContactSmoother
from contactsense.service.analysis.summarize import Summarizer
from contactsense.tracking.contact_track import NONE
from tests.contactsense.tracking.test_resumed_contact import Push, plain_scene, pushed_arm

SCENE = plain_scene()
PUSH = Push(0.0, 1.0, (0.0, -30.0, 0.0))


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def _history(localizer: Localizer, silent: tuple[float, float]) -> ContactHistory:
    samples = pushed_arm((PUSH,))
    names = ("t", "q", "qd", "joint_torque", "base_wrench")
    block = SampleBlock(*(np.array([getattr(sample, name) for sample in samples]) for name in names))
    assert block.base_wrench is not None
    readings = block.base_wrench.copy()
    readings[(block.t > silent[0]) & (block.t < silent[1])] = np.nan
    block = replace(block, base_wrench=readings)
    (found,) = localizer.run_blocks([block])
    collector = ContactCollector(SCENE.bandwidth)
    (history,) = [*collector.add(np.arange(len(block)), block, found), *collector.end()]
    return history


def test_a_moment_without_the_base_sensor_does_not_change_the_contact(localizer: Localizer) -> None:
    summarizer, smoother = Summarizer(SCENE), ContactSmoother(SCENE)
    whole, gap = (_history(localizer, silent) for silent in ((0.0, 0.0), (0.5, 0.65)))
    assert np.count_nonzero(~gap.usable) > 50
    expected, found = summarizer.summarize(whole, ""), summarizer.summarize(gap, "")
    assert (found.link, found.begin, found.duration) == (
        expected.link,
        expected.begin,
        pytest.approx(expected.duration, abs=0.01),
    )
    assert found.peak_force == pytest.approx(expected.peak_force, rel=0.05)
    assert found.impulse == pytest.approx(expected.impulse, rel=0.05)
    smoothed = smoother.smooth(gap.without_outages())
    assert smoothed is not None
    assert SCENE.link_names[smoothed.best.link] == expected.link


def test_a_contact_that_is_mostly_without_the_base_sensor_keeps_all_samples(localizer: Localizer) -> None:
    gap = _history(localizer, (0.5, 1.25))
    assert 0 < np.count_nonzero(gap.usable) < 0.5 * len(gap.usable)
    assert gap.without_outages() is gap


def test_a_base_sensor_that_is_there_in_the_pauses_only_changes_nothing(localizer: Localizer) -> None:
    whole = _history(localizer, (0.0, 0.0))
    pause = np.arange(len(whole.row)) >= 10
    history = replace(whole, phase=np.where(pause, NONE, whole.phase), usable=pause)
    assert history.without_outages() is history
    assert (history.strongest_stretch().phase != NONE).all()
