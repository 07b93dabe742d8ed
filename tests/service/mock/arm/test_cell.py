"""A user's own scene in the mock: mounting, tool, sensors; read back by what the service reads with."""

import numpy as np
import pytest

from contactsense.robots.primitives import Sphere
from contactsense.robots.tool import Tool
from contactsense.scene import JointTorqueSensor, LinkWrenchSensor, Scene, WrenchSensor
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import Friction
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import Script, ScriptError
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.interfaces.live_fields import LiveController
from contactsense.service.mock.physics.bodies import with_tool
from contactsense.service.sensors.signal_mapping import TorqueMap
from tests.oracles.pinocchio_arm import PinocchioArm

TINY = 1e-9
BALL = Tool(
    name="ball", mass=1.5, com=(0.0, 0.01, 0.05), primitives=(Sphere(center=(0, 0, 0.08), radius=0.04),)
)
SENSOR = WrenchSensor(
    force_noise=TINY,
    moment_noise=TINY,
    rpy=(0.1, 0.2, 0.3),
    translation=(0.01, 0.02, -0.05),
    sign="sensor_on_arm",
    bias=(1.0, 2.0, 3.0, 0.1, 0.2, 0.3),
)
WRIST = WrenchSensor(force_noise=TINY, moment_noise=TINY, rpy=(0.0, 0.0, 0.5), sign="sensor_on_arm")
SCRIPT = Script.model_validate(
    {
        "robot": "ur10e",
        "trajectory": {
            "start": [0.2, -1.3, 1.6, -1.9, -1.57, 0.4],
            "dwell": 0.1,
            "moves": [{"to": [0.8, -1.0, 1.2, -1.5, -1.2, 0.0], "duration": 1.0}],
        },
        "contacts": [
            {
                "link": "ball",
                "point": [0.04, 0.0, 0.08],
                "normal": [1, 0, 0],
                "push": 20.0,
                "start": 0.1,
                "duration": 0.9,
            }
        ],
    }
)


def scene(**fields):
    settings = {"robot": "ur10e", "mounting": (0.1, 2.5, 0.3), "tool": BALL, "base_wrench": SENSOR}
    settings |= {"wrist_wrench": WRIST, "joint_torque": JointTorqueSensor(noise=TINY)}
    return Scene(**settings | fields)


def oracle(here, reading, qdd, force):
    """Torques and base wrench by Pinocchio, with the push on the tool."""
    arm = PinocchioArm(with_tool(here.robot, here.tool), here.gravity_base)
    padded = [np.append(values, 0.0) for values in (reading.q, reading.qd, qdd)]
    point = np.array([0.04, 0.0, 0.08])
    push = np.array([-force, 0.0, 0.0])
    torque, wrench = arm.inverse_dynamics(*padded, [(7, push, np.cross(point, push))])
    return torque[:6], wrench


def test_a_mounted_arm_with_a_tool_reads_as_pinocchio_says():
    here = scene()
    robot = RobotController(Cell.of_scene(here), SCRIPT)
    for t in (0.3, 0.6, 0.8):
        robot.advance_to(t)
        reading, qdd = robot.at(t), robot.arm.qdd
        torque, wrench = oracle(here, reading, qdd, 20.0)
        np.testing.assert_allclose(reading.torque, torque, atol=1e-6)
        np.testing.assert_allclose(WrenchMap.of(SENSOR).wrench(reading.base), wrench, atol=1e-6)
        # The wrist sensor feels what is beyond it: the tool and the push.
        beyond = LinkSensorFrame(here, "wrist_wrench").wrench(reading.q, reading.wrist)
        bare, alone = oracle(scene(tool=BALL.model_copy(update={"mass": 0.0})), reading, qdd, 0.0)
        np.testing.assert_allclose(beyond, wrench - alone, atol=1e-5)
        assert np.abs(torque - bare).max() > 1.0


def test_a_sensor_between_links_reads_as_pinocchio_says():
    place = LinkWrenchSensor(
        name="elbow", link="forearm", translation=(0.02, 0.0, 0.05), rpy=(0.3, 0.2, -0.4),
        sign="sensor_on_arm", bias=(1, 2, 3, 4, 5, 6), force_noise=TINY, moment_noise=TINY,
    )  # fmt: skip
    here = scene(link_wrenches=[place])
    robot = RobotController(Cell.of_scene(here), SCRIPT)
    for t in (0.3, 0.6, 0.8):
        robot.advance_to(t)
        reading, qdd = robot.at(t), robot.arm.qdd
        arm = PinocchioArm(with_tool(here.robot, here.tool), here.gravity_base)
        push, point = np.array([-20.0, 0.0, 0.0]), np.array([0.04, 0.0, 0.08])
        arm.inverse_dynamics(
            *(np.append(values, 0.0) for values in (reading.q, reading.qd, qdd)),
            [(7, push, np.cross(point, push))],
        )
        # What the upper arm exerts on the forearm, in the forearm's frame.
        force, moment = arm.data.f[3].linear, arm.data.f[3].angular
        turn = place.rotation.T
        own = np.concatenate((turn @ force, turn @ (moment - np.cross(place.translation, force))))
        np.testing.assert_allclose(reading.links["elbow"], own + place.bias, atol=1e-5)


def test_readings_in_packets_are_late_by_the_delay_of_the_sensor():
    elbow = LinkWrenchSensor(name="elbow", link="forearm", delay=0.03)
    here = scene(wrist_wrench=WRIST.model_copy(update={"delay": 0.02}), link_wrenches=[elbow])
    robot = RobotController(Cell.of_scene(here), SCRIPT)
    controller = LiveController(robot)
    controller.advance(0.6)
    (sensor,) = robot.cell.links
    assert controller.moving_field("ft_raw_wrench")(0.6) == robot.at(0.58).wrist.tolist()
    read = [controller.moving_field(name)(0.6)[0] for name in sensor.fields]
    assert read == robot.at(0.57).links["elbow"].tolist()
    assert controller.moving_field("actual_q")(0.6) == robot.at(0.6).q.tolist()


def test_sensors_between_links_and_torques_have_registers_of_their_own():
    registers = [f"output_double_register_{i}" for i in range(48)]
    elbow = LinkWrenchSensor(name="elbow", link="forearm")
    torque = {"signal": "external_torque", "fields": registers[:6]}
    robot = RobotController(Cell.of_scene(scene(link_wrenches=[elbow], joint_torque=torque)), SCRIPT)
    (sensor,) = robot.cell.links
    assert sensor.fields == tuple(registers[6:12])
    controller = LiveController(robot)
    read = [controller.moving_field(name)(0.6)[0] for name in registers[:12]]
    assert read == [*robot.at(0.6).torque, *robot.at(0.6).links["elbow"]]
    eight = [elbow.model_copy(update={"name": f"elbow{i}"}) for i in range(8)]
    assert Cell.of_scene(scene(link_wrenches=eight)).links[-1].fields == tuple(registers[42:])
    with pytest.raises(ScriptError, match=r"joint_torque.fields leave room for 7, got 8"):
        Cell.of_scene(scene(link_wrenches=eight, joint_torque=torque))


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"sign": "on_arm", "bias": (0.5,) * 6},
        {"friction": Friction(coulomb=3.0, viscous=5.0, load=0.02)},
        {"meaning": "gravity_free"},
        {"signal": "actual_current", "torque_constants": (12.0,) * 6},
        {"signal": "actual_current_minus_target", "torque_constants": (12.0,) * 6},
        {"signal": "external_torque", "fields": tuple(f"output_double_register_{i}" for i in range(24, 30))},
    ],
    ids=lambda fields: "-".join(fields) or "plain",
)
def test_a_torque_signal_means_what_the_scene_says(fields):
    here = scene(joint_torque=JointTorqueSensor(noise=TINY, **fields))
    robot = RobotController(Cell.of_scene(here), SCRIPT)
    controller = LiveController(robot)
    robot.advance_to(0.6)
    signal = TorqueMap.of(here)
    values = {name: np.array(controller.moving_field(name)(0.6)) for name in signal.names}
    got = signal.torque(values) - np.array(here.joint_torque.bias)
    reading = robot.at(0.6)
    torque, _ = oracle(here, reading, robot.arm.qdd, 20.0)
    free, _ = oracle(here, reading, robot.arm.qdd, 0.0)
    still = reading._replace(qd=np.zeros(6))
    gravity, _ = oracle(here, still, np.zeros(6), 0.0)
    match here.joint_torque.contains:
        case "motor":
            expected = torque
        case "gravity_free":
            expected = torque - gravity
        case _:
            expected = torque - free
    if "friction" in fields:
        dry = 3.0 + 0.02 * np.abs(gravity)
        expected = expected + dry * np.tanh(reading.qd / 0.01) + 5.0 * reading.qd
    np.testing.assert_allclose(got, expected, atol=1e-6)


def test_the_tool_is_touched_on_its_surface_only():
    off = SCRIPT.contacts[0].model_copy(update={"point": (0.06, 0.0, 0.08)})
    with pytest.raises(ScriptError, match=r"on the surface of ball, got one 20\.0 mm outside"):
        RobotController(Cell.of_scene(scene()), SCRIPT.model_copy(update={"contacts": (off,)}))


def test_currents_need_their_constants():
    here = scene(joint_torque=JointTorqueSensor(signal="actual_current"), robot="ur5e")
    with pytest.raises(ScriptError, match=r"joint_torque\.signal actual_current: expected .*constants"):
        Cell.of_scene(here)
