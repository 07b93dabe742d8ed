"""The scoreboard for moving arms: what it counts, and that its model errors are what they say."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Contact, Estimate, robots
from contactsense.benchmarks.motion.command import measure, scene_for
from contactsense.benchmarks.motion.model_error import MASS_ERROR, friction, heavier
from contactsense.benchmarks.motion.score import Score
from contactsense.benchmarks.motion.streams import KINDS, Event, Stream, read, with_velocity_noise
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.residuals.recording_residuals import residuals
from tests.shared import shared

N = 1000


def _stream() -> Stream:
    """Two seconds at 500 Hz, a hold on link 3 from 0.4 to 0.8 s, an impact from 1.4 s."""
    touched = np.zeros(N, dtype=bool)
    touched[200:400] = touched[700:725] = True
    zero = np.zeros((N, 6))
    wrench = np.where(touched[:, None], [0.0, 0.0, -10.0, 0.0, 0.0, 0.0], 0.0)
    return Stream(
        robot="ur5e", gravity=9.81, suite="motion", run=0, kind="slow", multi=False,
        t=np.arange(N) * 0.002, q=zero, qd=zero, torque=zero, base_wrench=zero, noise_torque=zero,
        noise_wrench=zero, touched=touched, link=np.where(touched, 3, -1),
        point_base=np.tile([0.1, 0.2, 0.3], (N, 1)), normal_base=np.tile([0.0, 0.0, 1.0], (N, 1)),
        wrench=wrench,
        events=(Event(200, 400, "hold"), Event(700, 725, "impact")),
    )  # fmt: skip


def _estimates(answered: np.ndarray, link: int = 3) -> list[Estimate]:
    contact = Contact(
        "forearm", link, 0, 1.0, np.zeros(3), np.array([0.1, 0.2, 0.304]), np.array([0.0, 0.0, 1.0]),
        np.array([0.0, 0.0, -10.0]), 0.0, np.eye(3),
    )  # fmt: skip
    return [
        Estimate(0.002 * i, "contact" if hit else "none", (contact,) if hit else (), np.zeros(7),
                 np.zeros(6), np.zeros((6, 6)))
        for i, hit in enumerate(answered)
    ]  # fmt: skip


def test_noise_of_the_velocities_is_that_of_joints_that_move() -> None:
    stream = replace(_stream(), qd=np.tile([0.5, 0.0, 0.0, -0.1, 0.0, 0.0], (N, 1)))
    noise = with_velocity_noise(stream, 0.001).qd - stream.qd
    assert noise[:, [0, 3]].std() == pytest.approx(0.001, rel=0.1)
    assert not noise[:, [1, 2, 4, 5]].any()
    assert with_velocity_noise(stream, 0.0).qd is stream.qd


def test_what_is_found_missed_and_late() -> None:
    answered = np.zeros(N, dtype=bool)
    answered[210:405] = True  # the hold after 20 ms, a little longer than it lasts; the impact never
    score = Score()
    score.add(_stream(), _estimates(answered))
    assert score.touched == 225
    assert len(score.error) == 190
    np.testing.assert_allclose(score.error, 0.004)
    assert all(score.link_right)
    assert score.delay == pytest.approx([0.02])
    assert score.events == {"hold": 1, "impact": 1}
    assert score.missed == {"impact": 1}
    assert score.false_alarms == 0
    assert score.free == pytest.approx(2.0 - 0.002 * (200 + 100 + 25 + 100))


def test_a_contact_beside_another_one_has_no_delay() -> None:
    """Answers about the first one would hide when the second is detected, and whether it is."""
    stream = _stream()
    beside = replace(stream, events=(*stream.events, Event(300, 350, "impact")))
    score = Score()
    score.add(beside, _estimates(stream.touched))
    assert score.beside == 1
    assert score.events == {"hold": 1, "impact": 1}
    assert score.delay == pytest.approx([0.0, 0.0])
    assert score.missed == {}


def test_answers_are_taken_at_their_time_after_the_onset() -> None:
    """The hold lasts 0.4 s, the impact 50 ms; nothing is said in the first 50 ms."""
    answered = np.zeros(N, dtype=bool)
    answered[225:400] = True
    score = Score()
    score.add(_stream(), _estimates(answered))
    assert [answer[:3] for answer in score.answers] == [
        (0.02, False, False),
        (0.1, False, True),
        (0.3, False, True),
        (0.02, False, False),
    ]
    assert [answer.error for answer in score.answers] == pytest.approx([np.inf, 0.004, 0.004, np.inf])
    overlapping = Score()
    overlapping.add(replace(_stream(), multi=True), _estimates(answered))
    assert overlapping.answers == []


def test_false_alarms_are_counted_once_and_mask_what_begins_in_them() -> None:
    answered = np.zeros(N, dtype=bool)
    answered[20:40] = answered[44:50] = True  # one alarm with a short gap
    answered[650:720] = True  # another one, into which the impact falls
    score = Score()
    score.add(_stream(), _estimates(answered, link=2))
    assert score.false_alarms == 2
    assert score.masked == 1
    assert score.missed == {"hold": 1}
    assert not any(score.link_right)


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_probe_obeys_the_equations_of_motion_where_nothing_touches(robot: str) -> None:
    """Else the estimator sees in an arm that sets out what is the simulation's error."""
    streams = read(shared("truth"), robot, "probe")
    scene = scene_for(streams[0], COLUMNS[0], wrong=False)
    plant, free = CalibrationModel.of(scene), 0
    for stream in streams:
        stretch = FreeMotion(stream.t, stream.q, stream.qd, stream.torque, stream.base_wrench)
        before = slice(0, stream.events[0].start)
        left = residuals(plant, stretch, scene.bandwidth)[before]
        assert np.abs(left).max() < 1e-3  # N and Nm, a quarter of the least noise that is told
        free += len(left)
    assert free > 1000


def test_model_errors_are_what_they_say() -> None:
    robot = robots.load("ur5e")
    assert heavier(robot, MASS_ERROR).mass == pytest.approx(1.02 * robot.mass)
    still, moving = friction(np.array([np.zeros(6), np.full(6, 1.0)]))
    np.testing.assert_array_equal(still, 0.0)
    assert (moving > 0.0).all()


@pytest.mark.parametrize("suite", ["motion", "probe"])
def test_the_truth_is_read_run_by_run(suite: str) -> None:
    streams = read(shared("truth"), "ur5e", suite)
    assert {stream.kind for stream in streams} == set(KINDS if suite == "motion" else KINDS[:2])
    for stream in streams:
        assert (np.diff(stream.t) > 0.0).all()
        assert (stream.touched | (stream.link < 0)).all()
        strong = stream.link >= 0
        # The contact's wrench acts at its point: force times lever is the moment, but for torsion.
        moment = stream.wrench[strong, 3:] - np.cross(stream.point_base[strong], stream.wrench[strong, :3])
        assert np.abs(moment).max() < 0.01 * np.abs(stream.wrench[strong]).max() + 0.5


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [False, True])
def test_motion_costs_little_and_nothing_is_missed_or_made_up(wrong: bool) -> None:
    """UR5e at 0.25 N, 0.05 Nm, 1 Nm: slow motion at most 1.2 times the error at rest, fast motion at most
    twice."""
    found = {row["kind"]: row for row in measure(read(shared("truth"), "ur5e", "motion"), COLUMNS[2], wrong)}
    for kind, most in (("slow", 1.2), ("fast", 2.0)):
        assert found[kind]["ratio"]["median"] < most
        assert found[kind]["ratio"]["p95"] < most
        assert found[kind]["link_right"] > found[kind]["link_right_static"] - 0.02
    for row in found.values():
        assert row["missed"] == {}
        assert row["false_alarms"] == 0
        assert row["answered"] > 0.98
