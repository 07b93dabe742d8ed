"""The scoreboard: what counts as found, how far off, how soon."""

import numpy as np
import pytest

from contactsense.service.api.messages import EstimateOut
from contactsense.service.demo.scoreboard import Scoreboard, Verdict
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from tests.oracles.random_arm import random_arm

SCRIPT = Script.model_validate(
    {
        "robot": "random",
        "trajectory": {"start": [0.1, 0.2, 0.3], "dwell": 4.0},
        "contacts": [
            {
                "link": link,
                "point": [0.1, 0, 0],
                "force_base": [0, 0, -20],
                "start": start,
                "duration": 1.0,
                "ramp": 0.1,
            }
            for link, start in (("link_1", 1.0), ("link_3", 2.5))
        ],
    }
)


def estimate(t: float, link: str | None, point: np.ndarray, force: np.ndarray) -> EstimateOut:
    contact = {
        "link": link,
        "link_index": 0,
        "primitive": 0,
        "probability": 1.0,
        "point": [0.0] * 3,
        "point_base": point.tolist(),
        "normal_base": [0.0, 0.0, 1.0],
        "force_base": force.tolist(),
        "torsion": 0.0,
        "covariance": [[0.0] * 3] * 3,
    }
    return EstimateOut.model_validate(
        {
            "t": t,
            "status": "contact" if link else "none",
            "contacts": [contact] if link else [],
            "link_probability": [0.0] * 4,
            "wrench": [0.0] * 6,
            "covariance": [[0.0] * 6] * 6,
            "reason": "",
        }
    )


def play(motion: Motion, answers: dict[int, str | None], delay: float, offset: float = 0.0) -> list[Verdict]:
    """Verdicts where contact k is answered by `answers[k]`, `delay` [s] after its onset, `offset` [m] off."""
    board, verdicts = Scoreboard(motion), []
    for t in motion.t:
        said = estimate(float(t), None, np.zeros(3), np.zeros(3))
        for k, touch in enumerate(motion.touches):
            if touch.start + delay <= t <= touch.stop:
                i = round(t * motion.rate) - touch.first
                point = touch.point_base[i] + [offset, 0.0, 0.0]
                said = estimate(float(t), answers[k], point, 0.9 * touch.force_base[i])
        verdict = board.take(said)
        if verdict is not None:
            verdicts.append(verdict)
    assert board.done
    assert board.false_alarms == 0
    return verdicts


def test_all_right() -> None:
    first, second = play(simulate(SCRIPT, random_arm(1, 3)), {0: "link_1", 1: "link_3"}, 0.02, 0.003)
    for verdict in (first, second):
        assert verdict.right
        assert verdict.share == 1.0
        assert verdict.error == pytest.approx(0.003)
        assert verdict.force_error == pytest.approx(2.0)
        assert verdict.onset == pytest.approx(0.02)


def test_a_wrong_link_is_named_and_not_measured() -> None:
    first, second = play(simulate(SCRIPT, random_arm(1, 3)), {0: "link_2", 1: None}, 0.0)
    assert (first.right, first.link, first.share) == (False, "link_2", 0.0)
    assert np.isnan(first.error)
    assert np.isnan(first.onset)
    assert (second.right, second.link) == (False, None)


def test_why_estimates_were_degraded_is_counted() -> None:
    board, nowhere = Scoreboard(simulate(SCRIPT, random_arm(1, 3))), np.zeros(3)
    for reason in ("", "base_wrench is missing", "base_wrench is missing", "t runs back"):
        plain = estimate(0.1, None, nowhere, nowhere)
        board.take(plain.model_copy(update={"status": "degraded" if reason else "none", "reason": reason}))
    assert board.degraded == {"base_wrench is missing": 2, "t runs back": 1}


def test_contacts_where_there_are_none_are_false_alarms() -> None:
    board = Scoreboard(simulate(SCRIPT, random_arm(1, 3)))
    for t in (0.1, 0.2, 0.3):
        board.take(estimate(t, "link_1", np.zeros(3), np.zeros(3)))
    assert board.false_alarms == 3
