"""Joint velocities that are not those with which the joint positions change."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from contactsense.service.sensors.checks.plausibility import RobotCheck
from contactsense.service.sensors.checks.velocity_check import REST, VelocityCheck
from tests.shared import shared

LATE = 0.01
"""As for a robot's own packets [s]."""
Wrong = Callable[[float, np.ndarray], tuple[float, np.ndarray]]
"""From time and velocities to the wrong ones."""


def _motion(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of an arm whose joints oscillate, at up to 1 rad/s."""
    rate = np.linspace(1.0, 4.0, 6)
    return np.sin(rate * t) / rate, np.cos(rate * t)


@pytest.mark.parametrize("step", [0.002, 0.008, 0.05])
def test_velocities_of_the_same_motion_are_believed(step: float) -> None:
    check, rng = VelocityCheck(6, LATE), np.random.default_rng(0)
    for t in np.arange(0.0, 20.0, step):
        q, qd = _motion(t)
        noisy = qd + 0.02 * rng.standard_normal(6)
        # A loss of packets now and then, and a joint that is counted anew after each turn.
        if rng.random() > 0.1:
            turned = (q + np.array([t, 0.0, 0.0, 0.0, 0.0, 0.0]) + np.pi) % (2.0 * np.pi) - np.pi
            assert not check.contradict(t, turned, noisy + np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.slow
def test_no_velocity_of_a_real_arm_contradicts_its_positions() -> None:
    count = 0
    for path in sorted(shared("ur10e_recordings").glob("*.csv.gz")):
        check, robot = VelocityCheck(6, LATE), RobotCheck(np.full(6, np.pi))
        for t, *numbers in np.loadtxt(path, delimiter=",", usecols=range(13)):
            q, qd = np.split(np.array(numbers), 2)
            if not robot.velocities_impossible(qd):
                count += 1
                assert not check.contradict(t, q, qd)
    assert count > 50_000


def test_a_hard_stop_while_packets_are_lost_is_believed() -> None:
    check, speed = VelocityCheck(6, LATE), np.full(6, 2.0)
    for t in np.arange(0.0, 0.5, 0.002):
        assert not check.contradict(t, t * speed, speed)
    for t in np.arange(0.59, 1.0, 0.002):
        assert not check.contradict(t, 0.5 * speed, np.zeros(6))


WRONG: dict[str, Wrong] = {
    "zero": lambda t, qd: (t, np.zeros(6)),
    "sign": lambda t, qd: (t, -qd),
    "degrees": lambda t, qd: (t, np.degrees(qd)),
    "one frozen": lambda t, qd: (t, np.where(np.arange(6) == 2, 1.0, qd)),
    "clock at half speed": lambda t, qd: (1.0 + 0.5 * (t - 1.0), qd),
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_velocities_of_another_motion_are_told_and_forgotten(wrong: Wrong) -> None:
    check = VelocityCheck(6, LATE)
    told = []
    for t in np.arange(0.0, 5.0, 0.002):
        q, qd = _motion(t)
        stamp, velocity = wrong(t, qd) if 1.0 <= t < 2.0 else (t, qd)
        if check.contradict(stamp, q, velocity):
            told.append(t)
    assert 1.0 <= told[0] < 1.25
    assert 1.9 < told[-1] < 3.0
    assert sum(t < 2.0 for t in told) == round((2.0 - told[0]) / 0.002)  # without a break


def _stop_and_go(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of an arm that moves to and fro in 2 s each and rests for 1 s between."""
    reach = np.linspace(0.2, 1.2, 6)
    backwards = t % 6.0 >= 3.0
    s = min(t % 3.0 / 2.0, 1.0)
    place = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    speed = 30.0 * s**2 * (1.0 - s) ** 2 / 2.0
    return (reach * (1.0 - place), -reach * speed) if backwards else (reach * place, reach * speed)


BEGINS = [
    begin if begin in (0.1, 1.3, 2.5, 4.1, 5.3) else pytest.param(begin, marks=pytest.mark.slow)
    for begin in (round(0.1 + 0.4 * k, 1) for k in range(15))
]
"""Instants of a fault, of which some are in each phase of `_stop_and_go` [s]."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["zero", "sign", "degrees", "one frozen"])
@pytest.mark.parametrize("begin", BEGINS)
def test_a_wrong_velocity_is_not_believed_when_the_arm_moves_again(name: str, begin: float) -> None:
    check, end, step = VelocityCheck(6, LATE), begin + 6.0, 0.002
    first = None
    for t in np.arange(0.0, end + 6.0, step):
        q, qd = _stop_and_go(t)
        faulty = begin <= t < end
        _, velocity = WRONG[name](t, qd) if faulty else (t, qd)
        told = check.contradict(t, q, velocity)
        if told and first is None:
            first = t
        if t < begin or t > end + 3.0:  # once all joints have moved in agreement
            assert not told
        wrong = np.abs(velocity - qd).max() > 0.05
        if faulty and first is not None and wrong:
            # While a movement begins, no more than its first moment is believed.
            assert told or np.abs(q - _stop_and_go(t - 0.25)[0]).max() < 5.0 * REST
    assert first is not None
    assert first >= begin


@pytest.mark.parametrize(("late", "acceleration"), [(0.03, 1.0), (0.01, 20.0), (0.008, 40.0)])
def test_velocities_of_a_filter_are_believed(late: float, acceleration: float) -> None:
    check, step = VelocityCheck(1, LATE), 0.002
    speed = position = filtered = 0.0
    for t in np.arange(0.0, 3.0, step):
        before = speed
        # To at most 2 rad/s and back to rest, again and again.
        ramp = min(2.0 / acceleration, 0.7)
        speed = acceleration * max(min(t % 1.5, ramp, 1.4 - t % 1.5), 0.0)
        position += 0.5 * step * (before + speed)
        filtered += step / (late + step) * (speed - filtered)
        assert not check.contradict(t, np.array([position]), np.array([filtered]))


@pytest.mark.parametrize("late", [0.002, 0.005, 0.01])
@pytest.mark.parametrize("rate", [100, 500])
def test_velocities_are_believed_where_a_host_stamps_the_samples_late(late: float, rate: int) -> None:
    """Samples that arrive while it is busy have nearly the same stamp."""
    check, rng = VelocityCheck(6, 0.03), np.random.default_rng(0)
    stamp = -1.0
    for t in np.arange(0.0, 20.0, 1.0 / rate):
        q, qd = _motion(t)
        stamp = max(t + late * rng.random(), stamp + 1e-4)
        assert not check.contradict(stamp, q, qd)


@pytest.mark.parametrize("deceleration", [20.0, 50.0, 100.0, 400.0])
@pytest.mark.parametrize("speed", [0.3, 1.0, 2.0])
def test_a_hard_stop_with_velocities_of_a_filter_is_believed(speed: float, deceleration: float) -> None:
    check, step, fine = VelocityCheck(1, LATE), 0.002, 0.0001
    t = fine * np.arange(30_000)
    now = np.maximum(np.minimum(speed * np.minimum(t, 1.0), speed - deceleration * (t - 1.5)), 0.0)
    share = fine / LATE  # of the difference, which the filter follows in one step
    motion = np.column_stack([t, fine * np.cumsum(now), lfilter([share], [1.0, share - 1.0], now)])
    for stamp, position, filtered in motion[:: round(step / fine)]:
        assert not check.contradict(stamp, np.array([position]), np.array([filtered]))


@pytest.mark.slow
@pytest.mark.parametrize(("offset", "noise"), [(1e-3, 0.0), (0.0, 0.02)])
def test_offset_and_noise_of_the_velocity_at_rest_are_no_movement(offset: float, noise: float) -> None:
    check, rng = VelocityCheck(6, LATE), np.random.default_rng(0)
    for t in np.arange(0.0, 60.0, 0.002):
        assert not check.contradict(t, np.zeros(6), offset + noise * rng.standard_normal(6))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wrong_velocity_is_not_believed_after_a_gap_or_with_the_same_stamp(sign: float) -> None:
    check, told = VelocityCheck(6, LATE), []
    for k, t in enumerate(np.arange(0.0, 2.0, 0.002)):
        if k % 100 < 40:  # the gap is longer than velocities are integrated
            stamp = 0.01 * (k // 5) if k > 500 else t
            told.append(check.contradict(stamp, np.full(6, 0.5 * sign * t), np.zeros(6)))
    first = told.index(True)
    assert first < 30
    assert all(told[first:])


def _told(t: np.ndarray, q: np.ndarray, qd: np.ndarray) -> bool:
    """Whether the velocities of one joint ever contradict its positions."""
    check = VelocityCheck(1, LATE)
    return any(check.contradict(*sample) for sample in zip(t, q[:, None], qd[:, None], strict=True))


@pytest.mark.parametrize("speed", [1.0, -1.0])
@pytest.mark.parametrize(("factor", "wrong"), [(0.8, True), (0.88, False), (1.12, False), (1.2, True)])
def test_a_velocity_that_is_too_large_or_too_small(speed: float, factor: float, wrong: bool) -> None:
    """In steady motion at 1 rad/s the difference within 0.25 s may be 0.03 rad, and 0.01 rad for lateness."""
    t = np.arange(0.0, 3.0, 0.002)
    assert _told(t, speed * t, np.full(len(t), factor * speed)) == wrong


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("moved", "integral", "wrong"),
    [(0.004, 0.0, False), (0.007, 0.0, True), (0.0, 0.0105, False), (0.0, 0.014, True)],
)
def test_a_short_movement_without_a_velocity_and_a_velocity_without_movement(
    sign: float, moved: float, integral: float, wrong: bool
) -> None:
    """Within 0.1 s. A velocity may be late, so more of it is needed."""
    t = np.arange(0.0, 1.0, 0.002)
    q, qd = moved * np.clip(10.0 * (t - 0.2), 0.0, 1.0), 10.0 * integral * ((t > 0.2) & (t < 0.3))
    assert _told(t, sign * q, sign * qd) == wrong


@pytest.mark.parametrize(("gap", "wrong"), [(0.05, True), (0.2, False)])
def test_movements_before_a_long_gap_do_not_count(gap: float, wrong: bool) -> None:
    t = np.arange(0.0, 0.3, 0.002)
    q = 0.004 * (np.clip(50.0 * (t - 0.1), 0.0, 1.0) + np.clip(50.0 * (t - 0.2), 0.0, 1.0))
    assert _told(t + gap * (t > 0.16), q, np.zeros(len(t))) == wrong
