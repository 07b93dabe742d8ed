"""The simulated arm: its motion is smooth, its contacts do to the sensors what they should."""

import numpy as np
import pytest

from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.measured_velocity import REST
from contactsense.service.mock.arm.newton_euler import link_poses
from contactsense.service.mock.arm.script import Contact, Noise, Script, ScriptError, Trajectory
from contactsense.service.mock.arm.simulated_arm import joint_motion, simulate
from tests.oracles.random_arm import random_arm

ARM = random_arm(1, 3)
TRAJECTORY = Trajectory.model_validate(
    {
        "start": [0.1, 0.2, 0.3],
        "dwell": 0.5,
        "moves": [
            {"to": [1.0, -0.5, 0.3], "duration": 1.5, "dwell": 0.5},
            {"to": [0.1, 0.2, 0.3], "duration": 2.0, "dwell": 0.5},
        ],
    }
)


def script(*contacts: dict[str, object], **fields: object) -> Script:
    return Script.model_validate(
        {"robot": "random", "trajectory": TRAJECTORY, "contacts": contacts, **fields}
    )


def test_velocity_and_acceleration_belong_to_the_position() -> None:
    q, qd, qdd = joint_motion(TRAJECTORY, 1000.0)
    assert len(q) == 5000
    np.testing.assert_allclose(np.gradient(q, 1e-3, axis=0)[1:-1], qd[1:-1], atol=2e-5)
    np.testing.assert_allclose(
        np.gradient(qd, 1e-3, axis=0)[1:-1], qdd[1:-1], atol=2e-2
    )  # jerk jumps at the ends
    np.testing.assert_allclose(q[2200], [1.0, -0.5, 0.3])
    assert not qd[2200].any()


TOUCHES = [
    {"push": 20.0, "normal": [1.0, 2.0, -1.0], "torsion": 0.3},
    {"force_link": [1.0, -20.0, 3.0]},
    {"force_base": [5.0, 0.0, -25.0], "normal": [0.0, 0.0, 3.0], "torsion": -0.2},
]


@pytest.mark.parametrize("force", TOUCHES, ids=["push", "force_link", "force_base"])
@pytest.mark.parametrize("link", [0, 2, 3])
def test_a_contact_adds_its_wrench(link: int, force: dict[str, object]) -> None:
    contact = {
        "link": f"link_{link}",
        "point": [0.1, -0.2, 0.3],
        "start": 1.0,
        "duration": 2.0,
        "ramp": 0.1,
        **force,
    }
    motion, free = simulate(script(contact), ARM), simulate(script(), ARM)
    touch, delta = motion.touches[0], motion.base_wrench - free.base_wrench
    during = slice(touch.first, touch.last + 1)
    assert touch.link_index == link
    assert not delta[: touch.first].any()
    assert not delta[touch.last + 1 :].any()

    np.testing.assert_allclose(delta[during, :3], touch.force_base, atol=1e-9)
    rotations, origins = link_poses(ARM, motion.q[during])
    point = origins[link] + rotations[link] @ np.array(contact["point"])
    np.testing.assert_allclose(touch.point_base, point, atol=1e-12)
    couple = delta[during, 3:] - np.cross(point, touch.force_base)
    normal = rotations[link] @ (
        np.array(force.get("normal", [0.0, 0.0, 0.0])) / np.linalg.norm(force.get("normal", 1.0))
    )
    np.testing.assert_allclose(couple, touch.torsion[:, None] * normal, atol=1e-9)

    middle = len(touch.torsion) // 2
    if "force_base" in force:
        np.testing.assert_allclose(touch.force_base[middle], force["force_base"], atol=1e-12)
    if "push" in force:
        assert np.linalg.norm(touch.force_base[middle]) == pytest.approx(20.0)
        assert touch.force_base[middle] @ normal[middle] == pytest.approx(-20.0)

    # joints that do not carry the touched link feel nothing
    felt = motion.joint_torque - free.joint_torque
    assert not np.any(np.abs(felt[:, link:]) > 1e-9)
    assert link == 0 or np.any(np.abs(felt[:, :link]) > 1e-3)


def test_the_force_ramps() -> None:
    contact = {
        "link": "link_1",
        "point": [0, 0, 0],
        "force_base": [10, 0, 0],
        "start": 1.0,
        "duration": 1.0,
        "ramp": 0.2,
    }
    touch = simulate(script(contact), ARM).touches[0]
    force = touch.force_base[:, 0]
    assert force[0] == pytest.approx(0.0, abs=1e-9)
    assert force[50] == pytest.approx(5.0)
    np.testing.assert_allclose(force[100:401], 10.0)
    assert force[-1] == pytest.approx(0.0, abs=1e-3)


def test_noise_has_the_size_asked_for_and_repeats() -> None:
    noise = Noise(base_force=0.25, base_moment=0.05, joint_torque=1.0, seed=3)
    clean, noisy, again = (
        simulate(script(), ARM),
        simulate(script(noise=noise), ARM),
        simulate(script(noise=noise), ARM),
    )
    np.testing.assert_array_equal(noisy.base_wrench, again.base_wrench)
    np.testing.assert_array_equal(noisy.joint_torque, again.joint_torque)
    assert np.std(noisy.joint_torque - clean.joint_torque) == pytest.approx(1.0, rel=0.05)
    spread = np.std(noisy.base_wrench - clean.base_wrench, axis=0)
    np.testing.assert_allclose(spread, [0.25] * 3 + [0.05] * 3, rtol=0.06)


def test_it_can_loop_only_where_it_ends_where_it_began() -> None:
    assert simulate(script(), ARM).loops
    away = Trajectory.model_validate({"start": [0, 0, 0], "moves": [{"to": [1, 0, 0], "duration": 2.0}]})
    assert not simulate(script(trajectory=away), ARM).loops


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"trajectory": {"start": [0, 0]}}, "trajectory.start: expected 3 joint positions for random, got 2"),
        (
            {"trajectory": {"start": [0, 0, 7]}},
            r"trajectory.start: expected joint_2 within -6 to 6 rad, got 7 rad",
        ),
        (
            {"trajectory": {"start": [0, 0, 0], "moves": [{"to": [5, 0, 0], "duration": 1.0}]}},
            r"moves\[0\].to: expected joint_0 at no more than 3 rad/s, got 9.38 rad/s",
        ),
    ],
)
def test_a_script_that_the_arm_cannot_follow(fields: dict[str, object], complaint: str) -> None:
    with pytest.raises(ScriptError, match=complaint):
        simulate(script(**fields), ARM)


def test_a_script_with_obstacles_is_for_the_live_simulation() -> None:
    wall = {"kind": "half_space", "point": [-3.0, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}
    with pytest.raises(ScriptError, match=r"obstacles: expected none, .*`contactsense mock --script`"):
        simulate(script(obstacles=[wall]), ARM)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [("ur99", "robot: unknown robot 'ur99'"), ("gone.urdf", "robot: gone.urdf: no such")],
)
def test_an_arm_that_cannot_be_read_is_told_in_one_line(name: str, complaint: str) -> None:
    unknown = script(robot=name)
    with pytest.raises(ScriptError, match=complaint):
        simulate(unknown)
    with pytest.raises(ScriptError, match=complaint):
        Cell.of_script(unknown)


def test_an_unknown_link_is_told_the_names() -> None:
    contact = Contact(link="elbow", point=(0, 0, 0), force_base=(1, 0, 0), start=0.0, duration=1.0)
    with pytest.raises(
        ScriptError, match=r"contacts\[0\].link: expected one of link_0, link_1, .*got 'elbow'"
    ):
        simulate(script(contact.model_dump()), ARM)


def test_velocities_of_joints_that_move_have_noise_and_nothing_else_changes() -> None:
    exact, noisy = simulate(script(), ARM), simulate(script(noise={"joint_velocity": 0.002}), ARM)
    error = noisy.qd - exact.qd
    moves = np.abs(exact.qd) > 1e-3
    assert np.std(error[moves]) == pytest.approx(0.002, rel=0.1)
    assert not noisy.qd[np.abs(exact.qd) < REST].any()
    assert not error[(np.abs(exact.qd) >= REST) & ~moves].any()
    for name in ("q", "qdd", "joint_torque", "base_wrench"):
        np.testing.assert_array_equal(getattr(noisy, name), getattr(exact, name))
