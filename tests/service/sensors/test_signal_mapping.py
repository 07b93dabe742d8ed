"""What sensors say and what samples mean."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from contactsense import robots
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.signal_mapping import TorqueMap

number = st.floats(-3.0, 3.0)
triple = st.tuples(number, number, number)


def test_a_sensor_at_the_base_origin_says_it_as_it_is():
    assert np.array_equal(WrenchMap.of(WrenchSensor()).to_base, np.eye(6))


@given(triple, triple, triple, triple)
def test_a_force_is_the_same_force_from_wherever_it_is_felt(rpy, place, force, point):
    sensor = WrenchSensor(rpy=rpy, translation=place)
    turn = Rotation.from_euler("xyz", rpy).as_matrix()
    # A force at a point, about the sensor's origin in the sensor's axes, and about the base's in the base's.
    felt = np.concatenate([turn.T @ force, turn.T @ np.cross(np.subtract(point, place), force)])
    meant = np.concatenate([force, np.cross(point, force)])
    assert np.allclose(WrenchMap.of(sensor).to_base @ felt, meant, atol=1e-9)


@given(triple, triple, st.sampled_from(["arm_on_sensor", "sensor_on_arm"]))
def test_there_and_back(rpy, place, sign):
    both = WrenchMap.of(WrenchSensor(rpy=rpy, translation=place, sign=sign))
    assert np.allclose(both.to_base @ both.to_sensor, np.eye(6), atol=1e-9)


def test_a_sensor_that_counts_the_push_on_the_arm():
    reading = np.array([0.0, 0.0, 200.0, 1.0, 2.0, 3.0])
    assert np.allclose(WrenchMap.of(WrenchSensor(sign="sensor_on_arm")).to_base @ reading, -reading)


def test_torque_signals():
    direct = TorqueMap.of(Scene(robot="ur5e", joint_torque=JointTorqueSensor()))
    assert direct is not None
    assert (direct.names, direct.scale.tolist()) == (("actual_current_as_torque",), [1.0] * 6)
    constants = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    sensor = JointTorqueSensor(signal="actual_current", torque_constants=constants)
    current = TorqueMap.of(Scene(robot="ur5e", joint_torque=sensor))
    assert current is not None
    assert (current.names, tuple(current.scale)) == (("actual_current",), constants)
    assert TorqueMap.of(Scene(robot="ur5e", joint_torque=None)) is None


def test_currents_without_constants_are_refused():
    scene = Scene(robot="ur5e", joint_torque=JointTorqueSensor(signal="actual_current"))
    with pytest.raises(
        SensorError, match=r"expected joint_torque.torque_constants \[Nm/A\], 6 numbers: .* ur5e"
    ):
        TorqueMap.of(scene)


def test_the_constants_of_the_arm_are_used_where_the_scene_has_none():
    arm, constants = robots.load("ur5e"), (11.0, 12.0, 13.0, 14.0, 15.0, 16.0)
    joints = tuple(
        replace(joint, torque_constant=constant)
        for joint, constant in zip(arm.joints, constants, strict=True)
    )
    sensor = JointTorqueSensor(signal="actual_current")
    measured = TorqueMap.of(Scene(robot=replace(arm, joints=joints), joint_torque=sensor))
    assert measured is not None
    assert tuple(measured.scale) == constants


CONSTANTS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
SINGLE = tuple(f"current_of_joint_{i}" for i in range(6))
ACTUAL, TARGET = 3.0 * np.eye(6), np.eye(6)
"""Currents of six samples: in each, one joint has one."""


@pytest.mark.parametrize(
    ("fields", "torque"),
    [
        ({"signal": "actual_current_as_torque"}, 30.0 * np.eye(6)),
        ({"signal": "actual_current_as_torque", "sign": "on_arm"}, -30.0 * np.eye(6)),
        ({"signal": "actual_current_as_torque", "fields": SINGLE}, 7.0 * np.eye(6)),
        ({"signal": "actual_current"}, np.diag(CONSTANTS) * 3.0),
        ({"signal": "actual_current", "sign": "on_arm"}, np.diag(CONSTANTS) * -3.0),
        ({"signal": "actual_current_minus_target"}, np.diag(CONSTANTS) * 2.0),
        ({"signal": "actual_current_minus_target", "fields": SINGLE}, np.diag(CONSTANTS) * 6.0),
    ],
)
def test_the_torque_of_the_actuator_from_every_kind_of_signal(fields, torque):
    constants = CONSTANTS if fields["signal"] != "actual_current_as_torque" else None
    sensor = JointTorqueSensor(torque_constants=constants, **fields)
    values = {"actual_current": ACTUAL, "target_current": TARGET, "actual_current_as_torque": 10.0 * ACTUAL}
    values |= {name: 7.0 * np.eye(6)[:, [i]] for i, name in enumerate(SINGLE)}
    source = TorqueMap.of(Scene(robot="ur5e", joint_torque=sensor))
    assert source is not None
    assert np.array_equal(source.torque(values), torque)


@pytest.mark.parametrize(
    ("change", "same"),
    [({}, True), ({"sign": "on_arm"}, False), ({"signal": "actual_current_minus_target"}, False)],
)
def test_torques_of_another_sign_or_signal_are_others(change, same):
    maps = [
        TorqueMap.of(Scene(robot="ur5e", joint_torque={"torque_constants": CONSTANTS, **fields}))
        for fields in ({"signal": "actual_current"}, {"signal": "actual_current", **change})
    ]
    assert maps[0].is_as(maps[1]) == same
