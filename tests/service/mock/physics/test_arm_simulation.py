"""The simulated arm against the other dynamics of the mock, Pinocchio, and what physics asks for."""

import numpy as np
import pytest

from contactsense import robots
from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics
from contactsense.service.mock.arm.obstacles import BoxObstacle
from contactsense.service.mock.physics.arm_simulation import STEP, ArmSimulation, Push
from contactsense.service.mock.physics.bodies import with_tool
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.unknown_limits import without_limits

ARM = robots.load("ur5e")
HOME = np.array([0.3, -1.3, 1.6, -1.9, -1.57, 0.0])
BALL = Tool(
    mass=1.2,
    com=(0.0, 0.01, 0.05),
    tensor=(0.002, 0.0, 0.0, 0.002, 0.0, 0.001),
    primitives=(Sphere(center=(0.0, 0.0, 0.08), radius=0.04),),
)
TILTED = (1.0, -2.0, -9.5)


def still(q):
    return np.vstack([q, np.zeros((2, len(q)))])


def wave(t):
    """A smooth target and its derivatives."""
    rate = np.arange(1.0, 7.0)
    swing = 0.2
    return np.array(
        [
            HOME + swing * (1.0 - np.cos(rate * t)),
            swing * rate * np.sin(rate * t),
            swing * rate**2 * np.cos(rate * t),
        ]
    )


def state(simulation):
    return simulation.q[None], simulation.qd[None], simulation.qdd[None]


def locked(simulation):
    """The state with the joint of the tool, which stands still."""
    return tuple(np.hstack([values, np.zeros((1, 1))]) for values in state(simulation))


def loads(simulation):
    """Contacts with obstacles as wrenches on the links."""
    result = []
    for contact in simulation.contacts:
        R, o = simulation.rotations[contact.link], simulation.origins[contact.link]
        force, lever = R.T @ contact.force, R.T @ (contact.point - o)
        result.append(LinkLoad(contact.link, force[None], np.cross(lever, force)[None]))
    return result


def test_it_follows_its_target_and_the_sensors_read_what_the_motion_needs():
    # Tool, tilted gravity and a push: against the recursion over whole trajectories, and Pinocchio.
    arm = with_tool(ARM, BALL)
    simulation = ArmSimulation(ARM, HOME, tool=BALL, gravity=TILTED)
    oracle = PinocchioArm(arm, TILTED)
    force, moment = np.array([5.0, -8.0, 3.0]), np.array([0.4, 0.1, -0.6])
    for k in range(1500):
        simulation.step(wave(k * STEP), [Push(3, force, moment)] if k > 700 else [])
        if k % 100:
            continue
        pushes = [LinkLoad(3, force[None], moment[None])] if k > 700 else []
        torque, wrench = inverse_dynamics(arm, *locked(simulation), pushes, TILTED)
        np.testing.assert_allclose(simulation.torque, torque[0, :6], atol=1e-9)
        np.testing.assert_allclose(simulation.base_wrench, wrench[0], atol=1e-9)
        q, qd, qdd = (values[0] for values in locked(simulation))
        torque, wrench = oracle.inverse_dynamics(q, qd, qdd, [(3, force, moment)] if k > 700 else [])
        np.testing.assert_allclose(simulation.torque, torque[:6], atol=1e-8)
        np.testing.assert_allclose(simulation.base_wrench, wrench, atol=1e-8)
        assert np.abs(simulation.q - wave((k + 1) * STEP)[0]).max() < (2e-3 if k > 700 else 1e-5)


def test_the_wrench_at_the_flange_is_the_tools():
    simulation = ArmSimulation(ARM, HOME, tool=BALL)
    R = simulation.rotations[-1]
    weight = R.T @ np.array([0.0, 0.0, -9.81 * BALL.mass])
    np.testing.assert_allclose(simulation.last_link_wrench[:3], weight, atol=1e-9)
    np.testing.assert_allclose(simulation.last_link_wrench[3:], np.cross(BALL.com, weight), atol=1e-9)


def floor_below(simulation, gap, **fields):
    """A table so far below the tool's ball, and below no other link."""
    centre = simulation.origins[-1] + simulation.rotations[-1] @ np.array([0.0, 0.0, 0.08])
    top = float(centre[2]) - 0.04 - gap
    x, y, _ = (float(value) for value in centre)
    return BoxObstacle(center=(x, y, top - 0.05), half=(0.1, 0.1, 0.05), **fields)


def pressed(depth, steps=1500, **fields):
    """The arm pushed `depth` into a floor by moving its target down there; all states on the way."""
    free = ArmSimulation(ARM, HOME, tool=BALL)
    floor = floor_below(free, 0.002, **fields)
    simulation = ArmSimulation(ARM, HOME, tool=BALL, obstacles=[floor])
    jacobian = vertical_jacobian(simulation)
    way = -jacobian / (jacobian @ jacobian) * (depth + 0.002)
    rows = []
    for k in range(steps):
        s, rate = min(k * STEP, 1.0), float(k * STEP < 1.0)
        u = s * s * (3.0 - 2.0 * s)
        target = np.array([HOME + u * way, rate * 6 * s * (1 - s) * way, rate * 6 * (1 - 2 * s) * way])
        simulation.step(target)
        rows.append((simulation.contacts, simulation.q, simulation.torque, simulation.base_wrench))
    return simulation, target[0], rows


def vertical_jacobian(simulation):
    """How the height of the tool's ball changes with the joints, by differences."""
    poses = PinocchioArm(with_tool(ARM, BALL))
    import pinocchio

    def height(q):
        pinocchio.forwardKinematics(poses.model, poses.data, np.append(q, 0.0))
        return poses.data.oMi[7].act(np.array([0.0, 0.0, 0.08]))[2]

    q, step = simulation.q, 1e-6
    return np.array([(height(q + step * e) - height(q - step * e)) / (2 * step) for e in np.eye(6)])


def test_pressing_on_a_floor_ends_where_servo_and_floor_balance():
    stiffness = 30_000.0
    simulation, target, _ = pressed(0.004, stiffness=stiffness, damping=300.0)
    (contact,) = simulation.contacts
    assert contact.link == 7
    np.testing.assert_allclose(contact.force, [0.0, 0.0, stiffness * contact.depth], rtol=1e-6, atol=1e-6)
    # The servos hold exactly against the contact's torques: K (target - q) = -J^T f.
    servo = 100.0 * np.array([joint.torque_limit for joint in ARM.joints])
    expected = -vertical_jacobian(simulation) * contact.force[2]
    np.testing.assert_allclose(servo * (target - simulation.q), expected, atol=2e-3 * contact.force[2])
    # Joint torques and base wrench differ from those of the arm at rest by the contact's.
    torque, wrench = inverse_dynamics(with_tool(ARM, BALL), *locked(simulation), loads(simulation))
    np.testing.assert_allclose(simulation.torque, torque[0, :6], atol=1e-9)
    np.testing.assert_allclose(simulation.base_wrench, wrench[0], atol=1e-9)
    free, at_rest = inverse_dynamics(with_tool(ARM, BALL), *locked(simulation))
    np.testing.assert_allclose(simulation.base_wrench[2] - at_rest[0, 2], contact.force[2], rtol=1e-9)
    assert np.abs(simulation.torque - free[0, :6]).max() > 1.0


def test_force_is_stiffness_times_depth_plus_damping_times_speed():
    stiffness, damping = 10_000.0, 500.0
    _, _, rows = pressed(0.005, steps=900, stiffness=stiffness, damping=damping)
    touched = [(contacts[0].depth, contacts[0].force[2]) for contacts, *_ in rows if contacts]
    depth, force = np.array(touched).T
    assert len(depth) > 300
    speed = np.gradient(depth, STEP)
    middle = slice(20, -5)
    np.testing.assert_allclose(
        force[middle], (stiffness * depth + damping * speed)[middle], rtol=0.01, atol=0.05
    )
    assert np.all(force >= 0.0)


@pytest.mark.parametrize("damping", [0.0, 2000.0])
def test_an_elastic_obstacle_gives_back_what_it_took_and_a_damped_one_does_not(damping):
    free = ArmSimulation(ARM, HOME, tool=BALL)
    floor = floor_below(free, 0.001, stiffness=10_000.0, damping=damping)
    simulation = ArmSimulation(ARM, HOME, tool=BALL, obstacles=[floor])
    jacobian = vertical_jacobian(simulation)
    way = -jacobian / (jacobian @ jacobian) * 0.006
    work, stored, before = 0.0, 0.0, (0.0, 0.0)
    for k in range(2000):
        phase = 2.0 * np.pi * k * STEP / 2.0
        target = np.array(
            [
                HOME + 0.5 * (1 - np.cos(phase)) * way,
                0.5 * np.pi * np.sin(phase) * way,
                0.5 * np.pi**2 * np.cos(phase) * way,
            ]
        )
        simulation.step(target)
        contact = simulation.contacts[0] if simulation.contacts else None
        now = (contact.depth, contact.force[2]) if contact else (0.0, 0.0)
        work += 0.5 * (now[1] + before[1]) * (now[0] - before[0])  # of the arm on the floor
        stored = max(stored, 0.5 * 10_000.0 * now[0] ** 2)
        before = now
    assert not simulation.contacts
    assert stored > 0.05
    if damping:
        assert work > 0.05 * stored
    else:
        assert abs(work) < 1e-3 * stored


def test_the_same_steps_give_the_same_numbers():
    def run():
        simulation, _, rows = pressed(0.004, steps=400)
        return np.concatenate([simulation.q, simulation.torque, np.array(rows[350][3])])

    np.testing.assert_array_equal(run(), run())


def test_a_drive_at_its_limit_yields():
    simulation = ArmSimulation(ARM, HOME)
    push = Push(6, np.array([0.0, 60.0, 0.0]), np.array([0.0, 0.0, 60.0]))
    for _ in range(60):
        simulation.step(still(HOME), [push])
    # 60 Nm about the last axis, of which the drive bears 28.
    assert abs(simulation.q[5] - HOME[5]) > 0.02
    limits = np.array([joint.torque_limit for joint in ARM.joints])
    assert np.all(np.abs(simulation.torque) <= limits + 1e-6)


def test_an_arm_whose_limits_are_not_known_keeps_its_posture():
    simulation = ArmSimulation(without_limits(ARM), HOME)
    for _ in range(300):
        simulation.step(still(HOME), [])
    np.testing.assert_allclose(simulation.q, HOME, atol=1e-4)


def test_friction_opposes_sliding():
    free = ArmSimulation(ARM, HOME, tool=BALL)
    floor = floor_below(free, -0.003, stiffness=20_000.0, friction=0.4)  # already 3 mm deep
    simulation = ArmSimulation(ARM, HOME, tool=BALL, obstacles=[floor])
    turn = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    for k in range(300):
        simulation.step(np.array([HOME + turn * k * STEP, turn, 0.0 * turn]))
    (contact,) = simulation.contacts
    sliding = simulation.twist(7)
    velocity = sliding[:3] + np.cross(sliding[3:], contact.point - simulation.origins[7])
    assert np.linalg.norm(velocity[:2]) > 0.05
    pull = contact.force[:2]
    assert np.linalg.norm(pull) == pytest.approx(0.4 * contact.force[2], rel=1e-6)
    assert pull @ velocity[:2] == pytest.approx(
        -np.linalg.norm(pull) * np.linalg.norm(velocity[:2]), rel=1e-6
    )
