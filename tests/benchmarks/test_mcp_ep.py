"""The settings of others: how answers are matched and scored, and what torques alone cannot do."""

import numpy as np
import pytest

from contactsense.benchmarks.mcp_ep import judge, scene_of, sequence
from contactsense.benchmarks.peers.exploration_filter import Found
from contactsense.benchmarks.peers.one_by_one import OneByOne
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.benchmarks.static_truth.cases import Noise
from contactsense.benchmarks.torque_only import shares, touched

pytestmark = pytest.mark.slow  # its kernels compile for long

NONE = Noise(0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def touches() -> Touches:
    return Toucher(scene_of("ur5e", NONE), seed=1).draw(6, contacts=2, even=True)


def answered(touches: Touches, order: tuple[int, int]) -> Found:
    """The truth as the answer, the first contact alone and then both in that order."""
    link = np.full((6, 2, 2), -1)
    point = np.zeros((6, 2, 2, 3))
    link[:, 0, 0], point[:, 0, 0] = touches.link[:, 0], touches.point_base[:, 0]
    link[:, 1], point[:, 1] = touches.link[:, order], touches.point_base[:, order]
    return Found(link, point)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_answers_count_in_any_order(touches: Touches, order: tuple[int, int]) -> None:
    for judged in judge(answered(touches, order), touches):
        assert judged.success == judged.each == 1.0
        assert judged.rmse == 0.0
        assert judged.rmse_interval == (0.0, 0.0)


def test_a_contact_that_is_missing_is_a_failure(touches: Touches) -> None:
    found = answered(touches, (0, 1))
    found.link[0, 1, 1] = -1
    after_two = list(judge(found, touches))[1]
    assert after_two.success == pytest.approx(5 / 6)
    assert after_two.each == pytest.approx(11 / 12)
    low, high = after_two.success_interval
    assert low < 5 / 6 < high < 1.0


def test_the_interval_of_an_error_covers_runs_that_are_drawn_again(touches: Touches) -> None:
    found = answered(touches, (0, 1))
    found.point_base[::2, :, 0, 2] += 0.03
    one = next(judge(found, touches))
    assert one.rmse == pytest.approx(0.03 / np.sqrt(2.0))
    # Of six runs one to five are far, in nineteen of twenty draws.
    low, high = one.rmse_interval
    assert low == pytest.approx(0.03 / np.sqrt(6.0))
    assert high == pytest.approx(0.03 * np.sqrt(5.0 / 6.0))


def test_without_any_answer_the_error_is_infinite(touches: Touches) -> None:
    found = answered(touches, (0, 1))
    found.link[:] = -1
    one = next(judge(found, touches))
    assert one.rmse == np.inf
    assert one.rmse_interval == (np.inf, np.inf)


def test_far_is_no_success(touches: Touches) -> None:
    found = answered(touches, (0, 1))
    found.point_base[:, 1, 1, 2] += 0.03
    after_two = list(judge(found, touches))[1]
    assert after_two.success == 0.0
    assert after_two.each == pytest.approx(0.5)
    assert after_two.rmse == pytest.approx(0.03 / np.sqrt(2.0))


def test_contacts_are_added_one_after_another_on_different_links(touches: Touches) -> None:
    wrench, torque = sequence(touches, NONE, seed=0)
    np.testing.assert_allclose(wrench[:, 0], touches.base_wrench[:, 0])
    np.testing.assert_allclose(wrench[:, 1], touches.base_wrench.sum(axis=1))
    np.testing.assert_allclose(torque[:, 1], touches.joint_torque.sum(axis=1))
    assert (touches.link[:, 0] != touches.link[:, 1]).all()
    assert (touches.link > 0).all(), "the base link cannot be touched"


def test_ours_estimates_contacts_one_after_another(touches: Touches) -> None:
    measured = sequence(touches, NONE, seed=0)
    found, seconds = OneByOne(scene_of("ur5e", NONE), 2, 0.5).follow(touches.q, *measured)
    one, two = judge(found, touches)
    assert one.success == 1.0
    assert two.each >= 0.8
    assert (found.link[:, 0, 1] == -1).all(), "one contact is there, one is answered"
    assert seconds.shape == (2,)


@pytest.mark.long
def test_a_base_sensor_locates_what_torques_cannot() -> None:
    """On the base no joint feels anything, on the shoulder one; with a base sensor both are located."""
    touches = touched("ur5e", 40)
    alone, both = (shares("ur5e", touches, NONE, base) for base in (False, True))
    assert alone.located[:2].max() < 0.5
    assert both.located[:2].min() > 0.8
