"""Target motion: the trajectory in its own time, the speed slider, pauses and stops."""

import numpy as np
import pytest

from contactsense.service.mock.arm.script import Trajectory
from contactsense.service.mock.arm.simulated_arm import joint_motion
from contactsense.service.mock.controller.motion_generator import MotionGenerator

TRAJECTORY = Trajectory.model_validate(
    {
        "start": [0.0, 1.0],
        "dwell": 0.2,
        "moves": [{"to": [1.0, 0.5], "duration": 1.0, "dwell": 0.1}, {"to": [0.0, 1.0], "duration": 1.5}],
    }
)
DT = 1e-3


def steps(generator, seconds):
    rows = []
    for _ in range(round(seconds / DT)):
        generator.step(DT)
        rows.append(generator.target.copy())
    return np.array(rows)


def consistent(rows):
    """Velocities and accelerations are the derivatives of the positions, but where an acceleration jumps."""
    smooth = np.abs(np.diff(rows[:, 2], axis=0)).max(axis=1) < 0.3
    between = np.diff(rows[:, 0], axis=0) / DT
    np.testing.assert_allclose(between[smooth], 0.5 * (rows[1:, 1] + rows[:-1, 1])[smooth], atol=1e-4)


def test_at_full_speed_it_is_the_scripts_trajectory():
    generator = MotionGenerator(TRAJECTORY)
    generator.start()
    rows = steps(generator, 2.7)
    q, qd, qdd = joint_motion(TRAJECTORY, 1.0 / DT)
    np.testing.assert_allclose(rows[:, 0], q[1 : len(rows) + 1], atol=1e-9)
    np.testing.assert_allclose(rows[:, 1], qd[1 : len(rows) + 1], atol=1e-9)
    np.testing.assert_allclose(rows[:, 2], qdd[1 : len(rows) + 1], atol=1e-9)
    steps(generator, 0.2)
    assert generator.finished


def test_the_speed_slider_slows_it_down_along_the_same_way():
    generator = MotionGenerator(TRAJECTORY)
    generator.start()
    first = steps(generator, 0.6)
    generator.wanted = 0.25
    rest = steps(generator, 6.0)
    consistent(np.concatenate([first, rest]))
    middle = rest[400:1200]
    # Both joints still move in proportion, at a quarter of the speed at the same place.
    fast, _, _ = joint_motion(TRAJECTORY, 1.0 / DT)
    speed = np.gradient(fast[:, 0], DT)
    place = np.interp(middle[:, 0, 0], fast[200:1200, 0], speed[200:1200])
    np.testing.assert_allclose(middle[:, 1, 0], 0.25 * place, rtol=0.02, atol=2e-3)
    np.testing.assert_allclose(middle[:, 1, 1], -0.5 * middle[:, 1, 0], atol=1e-12)


def test_a_pause_and_going_on():
    generator = MotionGenerator(TRAJECTORY)
    generator.start()
    steps(generator, 0.7)
    generator.wanted = 0.0
    rows = steps(generator, 0.5)
    consistent(rows)
    assert generator.at_rest
    generator.wanted = 1.0
    consistent(steps(generator, 2.5))
    assert generator.finished
    np.testing.assert_allclose(generator.target[0], [0.0, 1.0])


def test_a_stop_decelerates_the_fastest_joint_as_asked():
    generator = MotionGenerator(TRAJECTORY)
    generator.start()
    steps(generator, 0.7)
    before = generator.target.copy()
    generator.stop(5.0)
    rows = steps(generator, 0.8)
    consistent(rows)
    speed = np.abs(before[1]).max()
    assert np.abs(rows[0, 2]).max() == pytest.approx(5.0)
    # v^2 / 2a for the fastest joint, in the same proportion for the other.
    np.testing.assert_allclose(rows[-1, 0] - before[0], before[1] * speed / 10.0, rtol=1e-9)
    assert generator.at_rest
    generator.follow()
    back = steps(generator, 6.0)
    consistent(back)
    np.testing.assert_allclose(generator.target[0], [0.0, 1.0])


def test_the_hardest_stop_is_one_at_once():
    generator = MotionGenerator(TRAJECTORY)
    generator.start()
    steps(generator, 0.7)
    before = generator.target.copy()
    generator.stop(1.7e308)
    generator.step(DT)
    np.testing.assert_array_equal(generator.target, [before[0], [0.0, 0.0], [0.0, 0.0]])
    assert generator.at_rest


def test_a_move_keeps_to_its_limits():
    generator = MotionGenerator(TRAJECTORY)
    generator.move(np.array([1.0, -1.0]), 0.5, 1.0)
    rows = steps(generator, 8.0)
    consistent(rows)
    assert np.abs(rows[:, 1]).max() == pytest.approx(0.5, rel=1e-3)
    assert np.abs(rows[:, 2]).max() <= 1.0
    np.testing.assert_allclose(rows[-1, 0], [1.0, -1.0])


def test_a_loop_goes_on():
    generator = MotionGenerator(TRAJECTORY, loop=True)
    generator.start()
    rows = steps(generator, 2.0 * TRAJECTORY.duration)
    half = len(rows) // 2
    np.testing.assert_allclose(rows[:half, 0], rows[half:, 0], atol=1e-9)
