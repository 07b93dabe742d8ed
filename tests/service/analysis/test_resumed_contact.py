"""A knock with its rebound is one contact of a recording, a double tap is two."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock
from contactsense.runtime.result_rows import FORCE
from contactsense.sample_blocks import BlockEstimates
from contactsense.sensors.stream_state import SETTLING_PERIODS
from contactsense.service.analysis import Analysis, analyze
from contactsense.service.analysis.samples.contact_history import ContactCollector, ContactHistory
from contactsense.service.recordings.export import write_columns
from contactsense.tracking.contact_track import NONE
from tests.contactsense.tracking.test_resumed_contact import KNOCK, REBOUND, Push, plain_scene, pushed_arm

SCENE = plain_scene()
TAP = Push(0.0, 0.1, (0.0, -30.0, 0.0))
UPPER_ARM = Push(0.17, 0.04, (0.0, 0.0, -60.0), 2, (-0.2, 0.0, 0.19))


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(SCENE)


def _block(pushes: Sequence[Push]) -> SampleBlock:
    samples = pushed_arm(pushes)
    names = ("t", "q", "qd", "joint_torque", "base_wrench")
    return SampleBlock(*(np.array([getattr(sample, name) for sample in samples]) for name in names))


def _analyzed(pushes: Sequence[Push], folder: Path, localizer: Localizer) -> Analysis:
    block, columns = _block(pushes), {}
    for name, values in (
        ("actual_q", block.q), ("actual_qd", block.qd), ("joint_torque", block.joint_torque),
        ("base_wrench", block.base_wrench),
    ):  # fmt: skip
        assert values is not None
        columns |= {f"{name}_{i}": values[:, i] for i in range(values.shape[1])}
    write_columns(folder / "run.parquet", {"timestamp": block.t, **columns})
    return analyze(folder / "run.parquet", SCENE, localizer=localizer)


def _histories(parts: Sequence[SampleBlock], localizer: Localizer) -> list[ContactHistory]:
    collector, found, at = ContactCollector(SCENE.bandwidth), [], 0
    for block, estimates in zip(parts, localizer.run_blocks(parts), strict=True):
        found += collector.add(np.arange(at, at + len(block)), block, estimates)
        at += len(block)
    return found + list(collector.end())


def test_a_knock_and_its_rebound_are_one_contact(tmp_path: Path, localizer: Localizer) -> None:
    found = _analyzed((KNOCK, REBOUND), tmp_path, localizer)
    (contact,) = found.contacts
    assert (contact.contact, contact.link, contact.complete) == (1, "forearm", True)
    assert contact.begin == pytest.approx(0.304, abs=0.006)
    # Until the observers have forgotten the rebound.
    assert contact.begin + contact.duration == pytest.approx(0.584, abs=0.02)
    assert contact.row_end == pytest.approx(292, abs=10)
    # Of two half sines, each 2 / pi of its height times its length; the pause has none.
    assert contact.impulse == pytest.approx((80.0 + 30.0) * 0.04 * 2.0 / np.pi, rel=0.06)
    pause = (contact.curve.t > 0.44) & (contact.curve.t < 0.47)
    assert not contact.curve.force[pause].any()
    assert contact.smoothed
    assert np.linalg.norm(contact.point - KNOCK.point) < 0.003


@pytest.mark.parametrize("second", [TAP._replace(begin=0.3), UPPER_ARM])
def test_a_double_tap_and_touches_of_different_links_are_two_contacts(
    tmp_path: Path, localizer: Localizer, second: Push
) -> None:
    found = _analyzed((TAP if second.link == TAP.link else KNOCK, second), tmp_path, localizer)
    assert [contact.contact for contact in found.contacts] == [1, 2]
    assert [contact.link for contact in found.contacts] == [
        "forearm",
        ("upper_arm", "forearm")[second.link - 2],
    ]


def test_a_contact_is_the_same_however_the_recording_is_cut(localizer: Localizer) -> None:
    block = _block((KNOCK, REBOUND, KNOCK._replace(begin=0.6)))
    whole = _histories([block], localizer)
    cut = _histories([block[at : at + 7] for at in range(0, len(block), 7)], localizer)
    assert [history.contact for history in whole] == [1, 2]
    assert np.any(whole[0].phase == NONE)
    assert np.array_equal(np.diff(whole[0].row), np.ones(len(whole[0].row) - 1))
    assert all(history.complete for history in (*whole, *cut))
    for one, other in zip(whole, cut, strict=True):
        for name in ("row", "phase", "sample", "rows"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_the_place_comes_from_the_strongest_stretch(localizer: Localizer) -> None:
    knock, both = (_histories([_block(pushes)], localizer)[0] for pushes in ((KNOCK,), (KNOCK, REBOUND)))
    for history in (knock, both):
        stretch = history.strongest_stretch()
        assert (stretch.phase != NONE).all()
        for name in ("row", "sample", "rows"):
            np.testing.assert_array_equal(getattr(stretch, name), getattr(knock, name))


def test_a_recording_that_ends_in_a_pause_has_the_whole_contact(localizer: Localizer) -> None:
    block = _block((KNOCK,))
    (history,) = _histories([block], localizer)
    (shorter,) = _histories([block[: history.row[-1] + 5]], localizer)
    assert history.complete
    assert shorter.complete
    np.testing.assert_array_equal(history.row, shorter.row)


def test_a_contact_ends_as_soon_as_it_cannot_resume(localizer: Localizer) -> None:
    """Not with the next one only: a recording of hours may have none."""
    block, collector, ends = _block((KNOCK,)), ContactCollector(SCENE.bandwidth), []
    parts = [block[at : at + 10] for at in range(0, len(block), 10)]
    for part, estimates in zip(parts, localizer.run_blocks(parts), strict=True):
        ended = collector.add(np.arange(len(part)), part, estimates)
        ends += [(part.t[-1] - history.t[-1], history.complete) for history in ended]
    assert collector.open_since is None
    assert ends == [(pytest.approx(SETTLING_PERIODS / SCENE.bandwidth, abs=0.03), True)]


def test_of_simultaneous_contacts_the_strongest_counts(localizer: Localizer) -> None:
    block = _block((KNOCK,))
    (estimates,) = localizer.run_blocks([block])
    weaker = estimates.rows.copy()
    weaker[:, FORCE] *= 0.5
    expected, *both = (
        next(iter([*collector.add(np.arange(len(block)), block, found), *collector.end()]))
        for found in (estimates, *_with_another_contact(estimates, weaker))
        for collector in [ContactCollector(SCENE.bandwidth)]
    )
    for history in both:
        np.testing.assert_array_equal(history.rows, expected.rows)
        np.testing.assert_array_equal(history.sample, expected.sample)


def _with_another_contact(estimates: BlockEstimates, rows: np.ndarray) -> Iterator[BlockEstimates]:
    """The estimates with these explanations of a second contact, before and after those of the first."""
    sample = np.repeat(estimates.sample, 2)
    for pair in ((rows, estimates.rows), (estimates.rows, rows)):
        both = np.stack(pair, axis=1).reshape(-1, rows.shape[1])
        probability = np.repeat(estimates.link_probability, 2, axis=0)
        yield replace(
            estimates, sample=sample, rows=both, link_probability=probability,
            contact=np.repeat(estimates.contact, 2),
        )  # fmt: skip
