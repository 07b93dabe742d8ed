"""The second look: windows without the low-pass, places within their covariance, slides followed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, SampleBlock, Scene, WrenchSensor
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.runtime.result_rows import POINT_BASE
from contactsense.service.analysis.samples.contact_history import ContactCollector, ContactHistory
from contactsense.service.analysis.samples.contact_windows import LARGEST_TURN, contact_windows
from contactsense.service.analysis.smoothing.contact_smoothing import ContactSmoother
from contactsense.service.analysis.summary.summarize import Summarizer
from tests.service.analysis.recordings import demo

SCENE = Scene(robot="ur5e")


@pytest.fixture(scope="module")
def histories() -> list[ContactHistory]:
    motion = demo()
    block = SampleBlock(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench)
    collector, found, at = ContactCollector(SCENE.bandwidth), [], 0
    for part in Localizer(SCENE).run_blocks([block]):
        rows = np.arange(at, at + len(part))
        found += collector.add(rows, block[at : at + len(part)], part)
        at += len(part)
    return found + list(collector.end())


def test_windows_hold_the_true_mean_force_also_where_it_changes(histories: list[ContactHistory]) -> None:
    motion = demo()
    for history, touch in zip(histories, motion.touches, strict=True):
        windows = contact_windows(history, SCENE.bandwidth)
        assert windows is not None
        length = windows.samples / motion.rate
        for w in range(len(windows.t)):
            first = round((windows.t[w] - length[w] / 2) * motion.rate) - touch.first
            last = first + int(windows.samples[w]) + 1
            if first < 0 or last > len(touch.force_base):
                continue
            true = np.trapezoid(touch.force_base[first:last], axis=0) / windows.samples[w]
            assert SCENE.base_wrench is not None
            noise = SCENE.base_wrench.force_noise / np.sqrt(windows.samples[w])
            # What the bias filter does not know is a few times the noise of a window.
            np.testing.assert_allclose(windows.base_wrench[w, :3], true, atol=6.0 * noise + 0.1)


def test_the_time_of_a_window_is_weighted_by_the_force(histories: list[ContactHistory]) -> None:
    """In a window in which the force rises or falls, most of it acts late or early."""
    motion, weighted, even = demo(), [], []
    for history, touch in zip(histories, motion.touches, strict=True):
        windows = contact_windows(history, SCENE.bandwidth)
        assert windows is not None
        for w, (begin, end) in enumerate(itertools.pairwise(history.t[windows.edges])):
            first, last = (round(t * motion.rate) - touch.first for t in (begin, end))
            if first < 0 or last + 1 > len(touch.force_base):
                continue
            force = np.linalg.norm(touch.force_base[first : last + 1], axis=1)
            true = np.average(np.linspace(begin, end, last + 1 - first), weights=force)
            weighted.append(windows.weighted_t[w] - true)
            even.append(windows.t[w] - true)
            assert begin <= windows.weighted_t[w] <= end
    assert np.sqrt(np.mean(np.square(weighted))) < 0.5 * np.sqrt(np.mean(np.square(even)))


def test_no_joint_turns_far_within_a_window(histories: list[ContactHistory]) -> None:
    """A window has one posture; a fast arm needs shorter ones."""
    history = max(histories, key=lambda history: len(history.t))
    speed, (begin, end) = 3.0, history.t[[0, -1]]
    fast = replace(history.block, qd=np.full_like(history.block.qd, speed))
    slow = contact_windows(history, SCENE.bandwidth)
    windows = contact_windows(replace(history, block=fast), SCENE.bandwidth)
    assert slow is not None
    assert windows is not None
    assert speed * (end - begin) / len(slow.t) > LARGEST_TURN
    assert speed * np.diff(history.t[windows.edges]).max() < 1.1 * LARGEST_TURN


def test_places_lie_within_their_covariance(histories: list[ContactHistory]) -> None:
    smoother, inside = ContactSmoother(SCENE), []
    for history, touch in zip(histories, demo().touches, strict=True):
        found = smoother.smooth(history)
        assert found is not None
        assert found.best.link == touch.link_index
        assert found.probability.sum() == pytest.approx(1.0)
        (point,), (normal,), (covariance,) = found.at(np.array([0.5 * (touch.start + touch.stop)]))
        error = point - touch.point_link
        assert np.linalg.norm(error) < 0.01
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        inside.append(error @ np.linalg.solve(covariance, error) < 16.3)  # 99.9 % of three dimensions
    assert np.mean(inside) > 0.85


def test_looking_again_is_no_worse_than_the_last_live_answer(histories: list[ContactHistory]) -> None:
    smoother, frames = ContactSmoother(SCENE), Summarizer(SCENE)
    live, smoothed = [], []
    for history, touch in zip(histories, demo().touches, strict=True):
        found = smoother.smooth(history)
        assert found is not None
        k = int(np.searchsorted(history.t[history.sample], touch.stop - 0.15))
        at = int(history.row[history.sample[k]]) - touch.first
        live.append(np.linalg.norm(history.rows[k, POINT_BASE] - touch.point_base[at]))
        origin, rotation = frames.link_pose(history.block.q[history.sample[k]], found.best.link)
        (point,), _, _ = found.at(history.t[history.sample[k : k + 1]])
        smoothed.append(np.linalg.norm(origin + rotation @ point - touch.point_base[at]))
    assert np.median(smoothed) <= 1.1 * np.median(live)


def test_with_a_wrist_sensor_contacts_below_it_are_smoothed(histories: list[ContactHistory]) -> None:
    tool = Tool(primitives=(Sphere(center=(0.0, 0.0, 0.1), radius=0.03),))
    smoother = ContactSmoother(Scene(robot="ur5e", tool=tool, wrist_wrench=WrenchSensor()))
    history, plain = histories[0], ContactSmoother(SCENE).smooth(histories[0])

    def with_tool(probability: float) -> ContactHistory:
        tool_column = np.full((len(history.rows), 1), probability)
        return replace(
            history, link_probability=np.hstack(((1.0 - probability) * history.link_probability, tool_column))
        )

    found = smoother.smooth(with_tool(0.0))
    assert found is not None
    assert plain is not None
    assert found.best.link == plain.best.link
    np.testing.assert_allclose(found.best.point, plain.best.point, atol=1e-4)
    # The tool's wrench is measured by the wrist sensor, which the smoother does not use.
    assert smoother.smooth(with_tool(0.2)) is None


def test_a_contact_of_a_few_samples_keeps_its_live_answer(histories: list[ContactHistory]) -> None:
    motion = demo()
    block = SampleBlock(motion.t, motion.q, motion.qd, motion.joint_torque, motion.base_wrench)
    short = block[: histories[0].row[0] + 3]
    collector = ContactCollector(SCENE.bandwidth)
    (part,) = Localizer(SCENE).run_blocks([short])
    list(collector.add(np.arange(len(short)), short, part))
    (history,) = collector.end()
    assert ContactSmoother(SCENE).smooth(history) is None
