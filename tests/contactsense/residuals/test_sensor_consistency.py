"""Sensors and models that no longer fit are said, and the stream goes on with what still works."""

import numpy as np
import pytest

from contactsense import Estimate, Localizer, Sample, Scene
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.sensor_consistency import (
    SensorConsistency,
    describe_inconsistency,
    exclude_inconsistent,
    restart,
    update_consistency,
)
from contactsense.robots.jit.flat_buffers import zeros
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
POSTURE = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
LINK = 3
DT = 0.008


def _stream(
    seconds: float,
    push: tuple[float, float] = (0.0, 0.0),
    torque_fault: tuple[float, float, np.ndarray] | None = None,
    dead: tuple[float, float] = (0.0, 0.0),
    louder: tuple[float, float] = (1.0, 1.0),
) -> tuple[list[Sample], np.ndarray]:
    """A resting arm, pushed with 25 N at the forearm from `push` on; the place. `torque_fault`: something is
    added to the torques from and until; `dead`: the base sensor reads zero; `louder`: factors on the noise of
    base and torques."""
    model, motion = build_model(ARM), empty_motion(6)
    zero = np.zeros(6)
    torque, wrench = weight(Scene(robot=ARM), POSTURE)
    forward_kinematics(model, POSTURE, motion)
    R, o = motion.rotation[LINK], motion.origin[LINK]
    point, f = R @ np.array([-0.2, 0.04, 0.007]) + o, R @ np.array([0.0, -25.0, 0.0])
    w = np.concatenate((f, np.cross(point, f)))
    seen = np.where(np.arange(6) < LINK, -motion.screw @ w, 0.0)
    chance, samples = np.random.default_rng(2), []
    for t in np.arange(0.0, seconds, DT):
        on = float(push[0] <= t < push[1])
        tau = torque + on * seen + louder[1] * chance.standard_normal(6)
        reading = wrench + on * w + louder[0] * np.repeat([0.25, 0.05], 3) * chance.standard_normal(6)
        if torque_fault is not None and torque_fault[0] <= t < torque_fault[1]:
            tau = tau + torque_fault[2]
        samples.append(
            Sample(float(t), POSTURE, zero, tau, 0.0 * reading if dead[0] <= t < dead[1] else reading)
        )
    return samples, point


def _at(estimates: list[Estimate], t: float) -> Estimate:
    return min(estimates, key=lambda estimate: abs(estimate.t - t))


def test_consistent_sensors_are_never_excluded(ordinary: Localizer) -> None:
    """A minute of which ten seconds are a contact."""
    samples, _ = _stream(60.0, push=(20.0, 30.0))
    estimates = list(ordinary.run(samples))
    assert {e.reason for e in estimates if e.t > 0.2} <= {""}
    assert {e.status for e in estimates if e.t > 0.2} <= {"none", "contact", "ambiguous"}


@pytest.mark.parametrize(("louder", "name"), [((1.4, 1.0), "base_wrench"), ((1.0, 1.4), "joint_torque")])
def test_more_noise_than_stated_is_reported(
    ordinary: Localizer, louder: tuple[float, float], name: str
) -> None:
    samples, _ = _stream(8.0, louder=louder)
    last = [e for e in ordinary.run(samples) if not e.contacts][-1]
    assert last.status == "degraded"
    assert last.reason.startswith(f"{name}: without contact its residual is 1.")


def test_contradicting_torques_are_excluded_until_consistent(ordinary: Localizer) -> None:
    """Drives of two joints go wrong for ten seconds: nothing is pushed, then the forearm is."""
    fault = np.array([0.0, 30.0, 0.0, -20.0, 0.0, 0.0])
    samples, point = _stream(24.0, push=(8.0, 10.0), torque_fault=(2.0, 12.0, fault))
    estimates = list(ordinary.run(samples))
    for t in (6.0, 9.5):
        assert _at(estimates, t).status == "degraded"
        assert "joint_torque is excluded" in _at(estimates, t).reason
    assert not _at(estimates, 7.5).contacts  # the base sensor alone feels nothing
    best = _at(estimates, 9.9).contacts[0]
    assert best.link_index == LINK
    assert np.linalg.norm(best.point_base - point) < 0.03
    assert _at(estimates, 23.0).status == "none"


def test_a_faulty_base_sensor_is_excluded_until_consistent(ordinary: Localizer) -> None:
    samples, _ = _stream(24.0, push=(8.0, 10.0), dead=(2.0, 12.0))
    estimates = list(ordinary.run(samples))
    assert "base_wrench is excluded" in _at(estimates, 6.0).reason
    assert not _at(estimates, 7.0).contacts
    pushed = _at(estimates, 9.9)
    assert pushed.status == "degraded"
    assert pushed.contacts
    assert pushed.link_probability[LINK] > 0.3  # torques alone leave the place open
    assert _at(estimates, 23.0).status == "none"


def test_a_new_stream_starts_with_consistent_sensors(ordinary: Localizer) -> None:
    samples, _ = _stream(8.0, louder=(1.4, 1.4))
    assert "times" in list(ordinary.run(samples))[-1].reason
    quiet, _ = _stream(1.0)
    assert list(ordinary.run(quiet))[-1].reason == ""


@pytest.mark.parametrize("single", [True, False])
def test_with_several_contacts_disagreement_excludes_no_sensor(single: bool) -> None:
    consistency, statistics = zeros(SensorConsistency), np.array([1.0, 1.0, 30.0, 0.0])
    restart(consistency, 20.0, single)
    wrong = [update_consistency(consistency, statistics, True, True, True, 0.01) for _ in range(1000)]
    usable = np.array([1, 1, 0, 1, 0])
    exclude_inconsistent(consistency, usable)
    np.testing.assert_array_equal(usable, (1, 0 if single else 1, 0, 1, 0))
    assert wrong[0] is False
    assert wrong[-1] is single
    assert len(describe_inconsistency(consistency)) == int(single)


LIMIT = 10.0 * 20.0
"""Smallest implausible force at the base, for contacts of usually 20 N [N]."""


class Monitor:
    def __init__(self) -> None:
        self.state = zeros(SensorConsistency)
        restart(self.state, 20.0, True)

    def run(self, seconds: float, *statistics: float, touched: bool = True) -> tuple[bool, bool]:
        """Which of base sensor and torques are used after that time."""
        for _ in range(round(seconds / 0.05)):
            update_consistency(self.state, np.array(statistics), touched, True, True, 0.05)
        usable = np.array([1, 1, 0])
        exclude_inconsistent(self.state, usable)
        return bool(usable[0]), bool(usable[1])


def test_a_base_sensor_that_is_excluded_contradicts_no_torques() -> None:
    assert Monitor().run(60.0, 1.0, 1.0, 30.0, 2.0 * LIMIT) == (False, True)


def test_a_large_force_that_the_torques_show_too_is_plausible() -> None:
    assert Monitor().run(60.0, 1.0, 30.0, 1.0, 2.0 * LIMIT) == (True, True)


def test_an_excluded_base_sensor_is_used_again_below_half_the_implausible_force() -> None:
    monitor = Monitor()
    assert monitor.run(5.0, 1.0, 1.0, 1.0, 1.1 * LIMIT) == (False, True)
    assert monitor.run(5.0, 1.0, 1.0, 1.0, 0.8 * LIMIT) == (False, True)
    assert monitor.run(5.0, 1.0, 1.0, 1.0, 0.4 * LIMIT) == (True, True)


def test_a_residual_that_was_too_large_is_so_until_it_is_clearly_smaller() -> None:
    for before, told in ((1.0, False), (2.0, True)):
        monitor = Monitor()
        monitor.run(20.0, before, 1.0, 1.0, 0.0, touched=False)
        monitor.run(20.0, 1.45, 1.0, 1.0, 0.0, touched=False)
        assert bool(describe_inconsistency(monitor.state)) is told
        monitor.run(20.0, 1.1, 1.0, 1.0, 0.0, touched=False)
        assert not describe_inconsistency(monitor.state)
