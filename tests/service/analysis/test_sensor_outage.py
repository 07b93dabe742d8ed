"""The base sensor is silent for a moment of a contact: force and place are those of the other moments."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock
from contactsense.service.analysis.analysis import analyze
from contactsense.service.analysis.sample_table import sample_table
from contactsense.service.analysis.samples.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.smoothing.contact_smoothing import ContactSmoother
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.recordings import Recording
from contactsense.tracking.contact_track import NONE
from tests.contactsense.tracking.test_resumed_contact import Push, plain_scene, pushed_arm

SCENE = plain_scene()
PUSH = Push(0.0, 1.0, (0.0, -30.0, 0.0))
AT_SHOULDER = Push(0.0, 1.0, (8.7, -28.7, -0.4), point=(-0.06, 0.04, 0.007))
"""On the forearm as well, but its line of action meets the shoulder, too: only joints distinguish them."""


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def _block(silent: tuple[float, float], field: str = "base_wrench", push: Push = PUSH) -> SampleBlock:
    samples = pushed_arm((push,))
    names = ("t", "q", "qd", "joint_torque", "base_wrench")
    block = SampleBlock(*(np.array([getattr(sample, name) for sample in samples]) for name in names))
    readings = getattr(block, field).copy()
    readings[(block.t > silent[0]) & (block.t < silent[1])] = np.nan
    return replace(block, **{field: readings})


def _history(localizer: Localizer, silent: tuple[float, float], field: str = "base_wrench") -> ContactHistory:
    block = _block(silent, field)
    (found,) = localizer.run_blocks([block])
    collector = ContactCollector(SCENE.bandwidth)
    (history,) = [*collector.add(np.arange(len(block)), block, found), *collector.end()]
    return history


def test_a_moment_without_the_base_sensor_does_not_change_the_contact(localizer: Localizer) -> None:
    summarizer, smoother = Summarizer(SCENE), ContactSmoother(SCENE)
    whole, gap = (_history(localizer, silent) for silent in ((0.0, 0.0), (0.5, 0.65)))
    assert np.count_nonzero(~gap.usable[:, 0]) > 50
    expected, found = summarizer.summarize(whole, ""), summarizer.summarize(gap, "")
    assert (found.link, found.begin, found.duration) == (
        expected.link,
        expected.begin,
        pytest.approx(expected.duration, abs=0.01),
    )
    assert found.peak_force == pytest.approx(expected.peak_force, rel=0.05)
    assert found.impulse == pytest.approx(expected.impulse, rel=0.05)
    assert expected.silent == 0.0
    lacking = ~gap.usable.all(axis=1)
    unknown = found.curve.t[np.isnan(found.curve.force)]
    assert len(unknown) == 1
    assert 0.5 < unknown[0] < 0.9
    assert not np.isnan(expected.curve.force).any()
    assert found.silent == pytest.approx(np.count_nonzero(lacking) * np.median(np.diff(gap.t)), rel=0.05)
    smoothed = smoother.smooth(gap.without_outages())
    assert smoothed is not None
    assert SCENE.link_names[smoothed.best.link] == expected.link


def test_a_contact_that_is_mostly_without_the_base_sensor_keeps_all_samples(localizer: Localizer) -> None:
    gap = _history(localizer, (0.5, 1.25))
    assert 0 < np.count_nonzero(gap.usable[:, 0]) < 0.5 * len(gap.usable)
    assert gap.sensed.tolist() == [False, True]
    assert gap.without_outages() is gap


def test_a_base_sensor_that_is_there_in_the_pauses_only_changes_nothing(localizer: Localizer) -> None:
    whole = _history(localizer, (0.0, 0.0))
    pause = np.arange(len(whole.row)) >= 10
    history = replace(whole, phase=np.where(pause, NONE, whole.phase), usable=pause[:, None] | [False, True])
    assert history.without_outages() is history
    assert (history.strongest_stretch().phase != NONE).all()


def _recording(block: SampleBlock) -> Recording:
    row = np.arange(len(block))
    return Recording("r", block.t, block.q, block.qd, block.joint_torque, block.base_wrench, None, row)


def test_a_sensor_that_is_silent_throughout_a_contact_has_not_measured_nothing() -> None:
    """Its residual stays as if nothing touched the arm, which would distinguish links that nothing has."""
    without = SCENE.model_copy(update={"joint_torque": None})
    silent = _block((0.17, 1.3), "joint_torque", AT_SHOULDER)
    (expected,), (found,) = (
        analyze(_recording(block), scene).contacts
        for block, scene in ((_block((0.0, 0.0), push=AT_SHOULDER), without), (silent, SCENE))
    )
    np.testing.assert_allclose(found.link_probability, expected.link_probability, atol=0.02)
    assert found.link_probability.max() < 0.9
    # As is a sensor that a recording has as a column without a single reading.
    (never,) = analyze(_recording(_block((-9.0, 9.0), "joint_torque", AT_SHOULDER)), SCENE).contacts
    np.testing.assert_allclose(never.link_probability, expected.link_probability, atol=0.02)


def test_the_table_of_samples_has_no_residuals_of_a_silent_sensor(localizer: Localizer) -> None:
    block = _block((0.2, 0.6), "joint_torque")
    (found,) = localizer.run_blocks([block])
    table = sample_table(np.arange(len(block)), found, SCENE)
    absent = ~found.usable[:, 1]
    assert absent[(block.t > 0.25) & (block.t < 0.6)].all()
    for name in ("joint_torque_0", "joint_torque_std_5"):
        np.testing.assert_array_equal(table.column(name).is_null().to_numpy(), absent)
    np.testing.assert_array_equal(table.column("base_wrench_2").is_null().to_numpy(), ~found.usable[:, 0])
