"""Cases and scores: the truth explains the measurements, failures count, our method agrees with the bench."""

import numpy as np
import pytest

from contactsense.benchmarks.accuracy.truth import measure
from contactsense.benchmarks.peers.cases import answer, errors, score, static_cases
from contactsense.benchmarks.peers.method import Answers, Located
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.benchmarks.static_truth.points import read, select
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from tests.shared import shared


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_external_parts_are_those_of_a_wrench_through_the_true_place(robot: str) -> None:
    folder = shared("truth")
    case = next(static_cases(robot, COLUMNS[:1], ["all"], rows=slice(0, 40), folder=folder))
    assert case.base_wrench is not None
    assert case.joint_torque is not None
    model = build_model(case.scene.robot)
    motion = empty_motion(model.joints)
    for i, point in enumerate(case.points.point_base):
        w = case.base_wrench[i]
        # Without torsion the moment about the contact vanishes; with it, it is at most 5 mm times the force.
        assert np.linalg.norm(w[3:] - np.cross(point, w[:3])) <= 0.00501 * np.linalg.norm(w[:3]) + 1e-5
        forward_kinematics(model, case.q[i], motion)
        asked = np.where(np.arange(model.joints) < case.points.link[i], motion.screw @ w, 0.0)
        assert case.joint_torque[i] == pytest.approx(-asked, abs=1e-5)


def test_no_answer_is_infinitely_far_and_wrong() -> None:
    points = select(read(shared("truth"), "ur5e"), slice(0, 100))
    answers = Answers(points.link.copy(), points.point_base + np.array([0.0, 0.003, 0.004]))
    answers.link[:4] = -1
    assert np.isinf(errors(answers, points)[:4]).all()
    first = score(answers, points)
    assert first.link_right == 0.96
    assert first.median == pytest.approx(0.005)
    assert first.p95 == pytest.approx(0.005)
    answers.link[:6] = -1
    assert np.isinf(score(answers, points).p95)


def test_our_method_scores_as_in_the_bench() -> None:
    folder = shared("truth")
    case = next(static_cases("ur5e", COLUMNS[2:3], ["all"], folder=folder))
    answers, seconds = answer(Located(case.scene), case)
    found = score(answers, case.points, seconds)
    bench = measure(read(folder, "ur5e"), COLUMNS[2])
    assert found.link_right == bench["link_right"]
    assert 1e3 * found.median == pytest.approx(bench["error_mm"]["median"], abs=1e-6)
    assert found.seconds > 0.0
