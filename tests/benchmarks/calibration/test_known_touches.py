"""Known touches in free motion: their torques are the mock's, and the summary tells true from false
probabilities."""

import numpy as np
import pytest

from contactsense import Localizer, robots
from contactsense.benchmarks.calibration.known_touches import (
    Touch,
    _joint_torques,
    calibrated_scene,
    detected_shares,
    read,
    summarize,
    touch,
)
from contactsense.benchmarks.posterior.samples import of_primitives
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics, link_poses
from tests.shared import shared


def test_the_torques_of_a_touch_are_those_of_the_mock() -> None:
    arm, rng = robots.load("ur10e"), np.random.default_rng(4)
    model, motion = build_model(arm), empty_motion(6)
    for link in range(2, 7):
        q, point, force = rng.uniform(-2.0, 2.0, 6), rng.uniform(-0.2, 0.2, 3), rng.normal(0.0, 40.0, 3)
        local = link_poses(arm, q[None])[0][link, 0].T @ force
        load = LinkLoad(link, local[None], np.cross(point, local)[None])
        still = np.zeros((1, 6))
        loaded, _ = inverse_dynamics(arm, q[None], still, still, [load])
        free, _ = inverse_dynamics(arm, q[None], still, still, [])
        forward_kinematics(model, q, motion)
        # The actuator balances the touch.
        np.testing.assert_allclose(_joint_torques(motion, point, link, force), (free - loaded)[0], atol=1e-9)


def drawn(stated: np.ndarray, true: np.ndarray, seed: int) -> list[Touch]:
    """Touches on link 3 or 4; link 3 is touched with probability `true`, and stated with `stated`."""
    rng = np.random.default_rng(seed)
    return [
        Touch("r", 3 if rng.random() < p else 4, 50.0, (0.0, 0.0, 0.0, s, 1.0 - s, 0.0, 0.0), False)
        for s, p in zip(stated, true, strict=True)
    ]


def test_true_probabilities_are_told_from_overconfident_ones() -> None:
    true = np.random.default_rng(5).uniform(0.02, 0.98, 4000)
    honest = summarize(drawn(true, true, 6))
    assert honest["calibration"]["error"] < honest["calibration"]["by_chance_95"]
    assert max(honest["log_score"], key=honest["log_score"].get) == 1.0
    sharpened = true**2 / (true**2 + (1.0 - true) ** 2)
    boastful = summarize(drawn(sharpened, true, 6))
    assert boastful["calibration"]["error"] > 2.0 * boastful["calibration"]["by_chance_95"]
    assert max(boastful["log_score"], key=boastful["log_score"].get) == 0.5
    assert boastful["right"] == honest["right"]


def test_detected_touches_are_counted_by_link_and_force() -> None:
    detected, missed = (0.0, 0.0, 0.0, 1.0), None
    touches = [
        Touch("r", 3, 20.0, missed, False),
        Touch("r", 3, 49.0, detected, True),
        Touch("r", 3, 50.0, detected, False),
        Touch("r", 3, 150.0, detected, False),
        Touch("r", 4, 30.0, missed, False),
    ]
    assert detected_shares(touches, np.array([20.0, 50.0, 150.0])) == {
        3: [(2, 1), (2, 2)],
        4: [(1, 0), (0, 0)],
    }


@pytest.mark.long
def test_the_probabilities_of_known_touches_on_a_real_arm_are_true() -> None:
    folder = shared("ur10e_recordings")
    scene = calibrated_scene(folder)
    localizer, samples = Localizer(scene), of_primitives(scene, 0.01)
    found = []
    for seed, name in enumerate(("collision_free", "validation-ptp_10_points", "jointwise-joint_4") * 2):
        found += touch(localizer, read(folder / f"{name}.csv.gz", scene)[0], samples, "area", seed)
    summary = summarize(found)
    assert summary["answered"] > 30
    assert summary["calibration"]["error"] < summary["calibration"]["by_chance_95"]
    assert summary["clear_wrong"] <= 0.1 * max(summary["clear"], 10)
