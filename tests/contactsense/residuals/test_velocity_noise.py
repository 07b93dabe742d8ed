"""Noise of the joint velocities and sudden changes of the accelerations."""

import numpy as np
import pytest

from contactsense.residuals.velocity_noise import (
    LARGEST_FIRST_NOISE,
    REFRESH_CHANGE,
    VelocityNoise,
    follow_velocity_noise,
    noise_gain,
)
from contactsense.robots.jit.flat_buffers import zeros


def followed(velocity: np.ndarray, dt: float | np.ndarray = 0.002) -> list[VelocityNoise]:
    """The state after each sample, for velocities (N, n)."""
    state = zeros(VelocityNoise, joints=velocity.shape[1])
    steps = np.broadcast_to(dt, len(velocity)).copy()
    steps[0] = 0.0
    found = []
    for qd, step in zip(velocity, steps.tolist(), strict=True):
        follow_velocity_noise(state, qd, step)
        found.append(VelocityNoise(*(np.array(array) for array in state)))
    return found


@pytest.mark.parametrize("dt", [0.002, 0.008, 0.01])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
@pytest.mark.parametrize("deviation", [0.0003, 0.001, 0.01])
def test_noise_is_measured_beneath_a_motion(dt: float, jitter: float, deviation: float) -> None:
    chance = np.random.default_rng(0)
    steps = dt * (1.0 + jitter * chance.uniform(-1.0, 1.0, 4000))
    t = np.cumsum(steps)
    motion = np.stack((0.5 * np.sin(0.8 * t), 1.0 + 0.2 * np.cos(t)), axis=1)
    found = followed(motion + deviation * chance.standard_normal(motion.shape), steps)
    variance = np.mean([state.present for state in found[1000:]], axis=0)
    # What exceeds three standard deviations counts less: 1 % of the variance.
    np.testing.assert_allclose(np.sqrt(variance), deviation, rtol=0.06)


@pytest.mark.parametrize("joints", [1, 6])
def test_white_noise_hardly_counts_as_a_sudden_change(joints: int) -> None:
    """The excess of a chi-square variable over its mean: for one joint half of the variance, for six a
    quarter."""
    chance, deviation, dt = np.random.default_rng(1), 0.001, 0.002
    found = followed(0.3 + deviation * chance.standard_normal((5000, joints)), dt)
    change = np.array([state.change for state in found[500:]])
    share = np.mean(change**2) / (6.0 * (deviation / dt) ** 2)
    assert share < (0.55 if joints == 1 else 0.3)


@pytest.mark.parametrize("deviation", [0.0, 0.001])
def test_a_hard_stop_is_a_sudden_change_and_hardly_noise(deviation: float) -> None:
    chance, t = np.random.default_rng(2), 0.002 * np.arange(600)
    speed = np.clip(1.0 - 30.0 * (t - 1.0), 0.1, 1.0)
    found = followed((speed + deviation * chance.standard_normal(len(t)))[:, None])
    begins = int(np.argmax(t > 1.0))
    around = np.array([state.change[0] for state in found[begins - 1 : begins + 2]])
    assert np.abs(around).max() > 15.0
    assert around.sum() == pytest.approx(-30.0, abs=10.0)
    assert found[begins + 5].present[0] < 2.0 * found[begins - 5].present[0] + 1e-9


def test_an_acceleration_that_vanishes_after_the_velocity_is_a_sudden_change() -> None:
    """The joint stops just before a sample: its acceleration changes in that one by little, by most in the
    next."""
    velocity = np.maximum(1.0 - 2.0 * 0.002 * np.arange(300), 0.0)
    velocity[250:] = 0.0
    change = np.array([state.change[0] for state in followed(velocity[:, None])])
    assert change[250] == pytest.approx(0.0, abs=1e-6)
    assert change[251] == pytest.approx(2.0, rel=1e-3)
    assert not change[252:].any()


def test_a_change_of_all_joints_together_is_found_in_noise() -> None:
    """Of each joint alone it is hardly larger than noise."""
    chance, t = np.random.default_rng(5), 0.002 * np.arange(1000)
    direction = np.array([1.0, -0.6, 0.8, 0.9, -1.0, 1.2])
    shares = []
    for i in range(20):
        speed = 0.3 + np.outer(2.5 * np.maximum(t - 1.0 - 1e-4 * i, 0.0), direction)
        found = followed(speed + 0.001 * chance.standard_normal(speed.shape))
        at = int(np.argmax(t > 1.0 + 1e-4 * i))
        square = max(np.sum(state.change**2) for state in found[at : at + 2])
        shares.append(square / np.sum((2.5 * direction) ** 2))
    assert np.median(shares) > 0.6


def test_a_joint_at_rest_has_no_noise_and_remembers_its_own() -> None:
    chance = np.random.default_rng(3)
    velocity = 0.02 + 0.004 * chance.standard_normal((1000, 1))
    velocity[500:700] = 0.0
    found = followed(velocity)
    assert found[450].present[0] == pytest.approx(0.004**2, rel=0.5)
    assert found[600].present[0] == 0.0
    assert found[701].present[0] == pytest.approx(0.004**2, rel=0.5)


def test_when_a_joint_moves_for_the_first_time_the_largest_sample_counts() -> None:
    velocity = np.zeros((60, 1))
    velocity[10:, 0] = 0.001 * np.random.default_rng(10).standard_normal(50)
    found = followed(velocity)
    assert found[9].present[0] == 0.0
    # Before it there is no noise.
    assert found[10].present[0] == pytest.approx(velocity[10, 0] ** 2)
    present = [state.present[0] for state in found[10:20]]
    assert present == sorted(present)
    assert present[-1] > 0.001**2


def test_the_beginning_of_a_motion_is_not_remembered_as_noise() -> None:
    """As that of a ramp of the speed."""
    velocity = 1.4 * 0.002 * np.maximum(np.arange(200) - 20.4, 0.0)
    found = followed(velocity[:, None])
    assert found[22].present[0] > 0.001**2
    assert found[60].present[0] < 1e-20


def test_what_depends_on_it_is_refreshed_when_joints_begin_to_move_and_every_10_ms() -> None:
    velocity = np.full((400, 2), 0.1) + 0.001 * np.random.default_rng(4).standard_normal((400, 2))
    velocity[:100] = 0.0
    velocity[:200, 1] = 0.0
    due = np.array([state.history[0]["due"] for state in followed(velocity)])
    assert due[0]
    assert not due[1:100].any()
    assert due[100]
    assert due[200]
    assert all(due[i : i + 6].any() for i in range(100, 394))
    assert due[250:].mean() < 0.3


def test_a_restart_forgets_everything() -> None:
    state = zeros(VelocityNoise, joints=1)
    for i in range(50):
        follow_velocity_noise(state, np.array([0.3 + 0.05 * (-1.0) ** i]), 0.002 if i else 0.0)
    assert state.present[0] > 1e-4
    follow_velocity_noise(state, np.array([0.3]), 0.0)
    assert state.present[0] == 0.0
    assert state.samples[0] == 0.0


@pytest.mark.parametrize("gap", [0.1, 0.5, 10.0])
def test_after_a_gap_the_noise_is_still_an_average(gap: float) -> None:
    """One sample alone is a hundredth of the variance in every twelfth case."""
    chance, steps = np.random.default_rng(6), np.full(260, 0.002)
    steps[200] = gap
    after = [
        found[i].present[0] / 0.001**2
        for _ in range(50)
        for found in [followed(0.3 + 0.001 * chance.standard_normal((260, 1)), steps)]
        for i in (200, 210)
    ]
    assert min(after) > 0.3
    assert max(after) < 3.0


def test_slow_samples_have_the_same_noise() -> None:
    velocity = 0.3 + 0.001 * np.random.default_rng(7).standard_normal((2000, 2))
    variance = np.array([state.present for state in followed(velocity, 0.1)[100:]])
    assert np.quantile(variance, 0.01) > 0.2 * 0.001**2
    np.testing.assert_allclose(np.sqrt(variance.mean(axis=0)), 0.001, rtol=0.06)


def test_a_wrong_value_at_rest_is_no_noise_of_the_next_motion() -> None:
    chance = np.random.default_rng(8)
    velocity = np.zeros((1000, 1))
    velocity[20] = 100.0
    velocity[500:] = 0.3 + 0.001 * chance.standard_normal((500, 1))
    found = followed(velocity)
    assert found[21].history[0]["changes"]
    assert np.sqrt(found[500].present[0]) <= LARGEST_FIRST_NOISE
    assert found[-1].present[0] == pytest.approx(0.001**2, rel=0.5)


def creeping(joints: int = 1) -> np.ndarray:
    """Velocities (2000, joints) of joints that creep, without noise in samples 500 to 1500."""
    noise = 0.001 * np.random.default_rng(12).standard_normal((2000, joints))
    noise[500:1500] = 0.0
    return 5e-4 + noise


def test_noise_that_vanishes_while_a_joint_creeps_is_not_forgotten() -> None:
    """It is back with the first sample that has noise, not only when it has been measured again."""
    found = followed(creeping())
    assert found[1499].present[0] < 1e-8 * 0.001**2
    for state in found[1500:1600]:
        assert state.present[0] == pytest.approx(0.001**2, rel=0.7)


def test_noise_is_not_forgotten_between_creeping_and_rest() -> None:
    """Where the first two samples of the next motion do not count in the average."""
    velocity = creeping()
    velocity[1400:1500] = 0.0
    found = followed(velocity)
    assert found[1450].present[0] == 0.0
    for state in found[1500:1600]:
        assert state.present[0] == pytest.approx(0.001**2, rel=0.7)


def test_what_depends_on_it_is_refreshed_when_the_noise_of_one_joint_is_back() -> None:
    """However small it is in the sum, and however short a time ago that was."""
    chance = np.random.default_rng(13)
    for back in range(1500, 1506):
        velocity = creeping(6)
        velocity[1500:back, 0] = 5e-4
        velocity[:, 1:] = 5e-4 + 0.002 * chance.standard_normal((2000, 5))
        assert followed(velocity)[back].history[0]["due"]


def test_noise_that_has_become_less_is_less() -> None:
    """Its return would exceed five standard deviations, which the lesser noise does not."""
    chance, deviation = np.random.default_rng(14), np.repeat([0.01, 0.001, 0.0001], 2000)[:, None]
    found = followed(0.3 + deviation * chance.standard_normal((6000, 1)))
    for state, expected in zip(found[::100], deviation[::100, 0].tolist(), strict=True):
        if state.history[0]["count"] % 2000 > 400:
            assert state.present[0] == pytest.approx(expected**2, rel=0.7)


@pytest.mark.parametrize(("creep", "begins"), [(0.0, 20), (5e-4, 5)])
def test_motion_without_noise_leaves_none_to_come_back(creep: float, begins: int) -> None:
    """Where its ramps begin and end there are sudden changes, also in the first samples of the stream."""
    velocity = creep + 1.4 * 0.002 * np.clip(np.arange(1000) - begins - 0.4, 0.0, 880.0)
    found = followed(velocity[:, None])
    assert found[begins + 882].history[0]["changes"]
    assert max(state.present[0] for state in found[begins + 880 :]) < 1e-12


def test_noise_that_has_vanished_is_measured_when_it_is_back() -> None:
    """At a constant velocity without noise the variance falls below what a number can hold."""
    chance = np.random.default_rng(9)
    velocity = np.full((30000, 1), 0.3)
    velocity[-4000:] += 0.001 * chance.standard_normal((4000, 1))
    steps = np.where(np.arange(30000) < 26000, 0.05, 0.002)
    found = followed(velocity, steps)
    assert found[25000].present[0] < 1e-300
    assert found[-1].present[0] == pytest.approx(0.001**2, rel=0.5)


def test_a_restart_at_rest_is_a_start_at_rest() -> None:
    state = zeros(VelocityNoise, joints=1)
    for i in range(50):
        follow_velocity_noise(state, np.array([0.3]), 0.002 if i else 0.0)
    follow_velocity_noise(state, np.zeros(1), 0.0)
    assert state.present[0] == 0.0
    assert state.samples[0] == 0.0


@pytest.mark.parametrize("moving", [1, 2, 3, 10])
def test_only_samples_since_rest_have_noise(moving: int) -> None:
    newest, before = 1.0 / 0.002, 1.0 / 0.005
    factors = np.array([newest, -(newest + before), before])
    assert noise_gain(newest, before, moving) == pytest.approx(np.sum(factors[:moving] ** 2))


def test_a_joint_that_begins_anew_begins_with_one_sample() -> None:
    velocity = np.full((30, 1), 0.3)
    velocity[10:20] = 0.0
    assert [int(state.moving[0]) for state in followed(velocity)[18:22]] == [0, 0, 1, 2]


def test_in_the_first_samples_the_largest_counts() -> None:
    """Until there are enough for an average."""
    velocity = np.full((40, 1), 0.3)
    velocity[4] += 0.01
    found = followed(velocity)
    largest = 0.02**2 / 6.0
    for state in found[5:10]:
        assert state.present[0] == pytest.approx(largest)
    assert found[-1].present[0] < 0.5 * largest


def test_what_depends_on_it_is_never_far_off() -> None:
    """Neither where the noise rises nor where it falls, nor when a restart brings another posture."""
    chance = np.random.default_rng(10)
    deviation = np.repeat([0.01, 0.0001, 0.003, 0.0001], [12, 100, 100, 288])[:, None]
    for state in followed(0.3 + deviation * chance.standard_normal((500, 2))):
        total, then = state.present.sum(), state.history[0]["sum_then"]
        assert then / REFRESH_CHANGE <= total * (1.0 + 1e-9)
        assert total <= REFRESH_CHANGE * then * (1.0 + 1e-9)
    state = zeros(VelocityNoise, joints=1)
    for step in (0.0, 0.002, 0.0):
        follow_velocity_noise(state, np.array([0.3]), step)
        assert bool(state.history[0].due) == (step == 0.0)


def test_a_hard_stop_has_the_inertia_of_its_own_posture() -> None:
    """However short a time ago it was worked out."""
    chance, stopped = np.random.default_rng(11), 0
    for begins in range(200, 212):
        velocity = 0.3 - 0.1 * np.clip(np.arange(240) - begins, 0.0, 2.0)
        found = followed(velocity[:, None] + 0.0005 * chance.standard_normal((240, 1)))
        stopped += all(found[i].history[0]["due"] for i in (begins + 1, begins + 3))
    assert stopped == 12
