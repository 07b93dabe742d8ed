"""The scene as the kernels see it: everything about arm, tool, sensors and surface that no sample changes."""

from typing import NamedTuple

import numpy as np

from contactsense.drive import Drive, make_drive
from contactsense.energy import Prior
from contactsense.isolation import Sensors
from contactsense.levels import stream_levels
from contactsense.places import Parts, Places, find_places
from contactsense.scene import Scene
from contactsense.sensing import JointTorqueSensor, WrenchSensor, per_joint
from kinematics.model import Model, build_model
from robots import Inertia, Link, Robot
from robots.surface import Surfaces, pack
from robots.tool import join_inertia, move_inertia


class Arm(NamedTuple):
    """Constant arrays for the sample path, made once from a `Scene`."""

    model: Model
    """Kinematics and inertia, the tool joined to the last link."""
    surfaces: Surfaces
    """Touchable surface; a tool's primitives are given in the frame of the last link."""
    places: Places
    """Places that stand for that surface, frames likewise."""
    parts: Parts
    """The parts of their cells."""
    sensors: Sensors
    """What sees which link, and the noise."""
    prior: Prior
    """What is known of contacts beforehand."""
    touchable: np.ndarray
    """1 for links that can be touched, else 0, shape (links,), int64."""
    gravity: np.ndarray
    """Gravity, base axes, shape (3,) [m/s^2]."""
    tool_mass: float
    """Mass beyond the wrist sensor [kg]."""
    tool_com: np.ndarray
    """Its centre of mass, last link's frame, shape (3,) [m]."""
    tool_inertia: np.ndarray
    """Its inertia about that, last link's axes, shape (3, 3) [kg m^2]."""
    wrist_rotation: np.ndarray
    """Orientation of the wrist sensor in the last link's frame, shape (3, 3)."""
    wrist_origin: np.ndarray
    """Origin of the wrist sensor in the last link's frame, shape (3,) [m]."""
    drive: Drive
    """What the joint torque signal contains beside the contact."""
    bias_rate: float
    """Inverse of the time over which biases are averaged, 0: they are constant [1/s]."""
    levels: np.ndarray
    """Energies at which contacts begin and end, see `contactsense.levels.stream_levels`."""


def build_arm(scene: Scene) -> Arm:
    """Arrays for the kernels."""
    flange_rotation, flange_origin = scene.robot.flange_rotation, scene.robot.flange_translation
    tool = carried_tool(scene)
    torque = scene.joint_torque or JointTorqueSensor()
    wrist = scene.wrist_wrench or WrenchSensor()
    surfaces = _surfaces(scene)
    places, parts, area = find_places(surfaces)
    return Arm(
        model=carried_model(scene),
        surfaces=surfaces,
        places=places,
        parts=parts,
        sensors=_sensors(scene),
        prior=Prior(
            lean=scene.friction / 2.0,
            lever=scene.torsion,
            offset=scene.surface_deviation,
            force=scene.force,
            room=scene.room,
            area=area,
        ),
        touchable=np.array(
            [scene.touchable is None or name in scene.touchable for name in scene.link_names], dtype=np.int64
        ),
        gravity=scene.gravity_base,
        tool_mass=tool.mass,
        tool_com=tool.com,
        tool_inertia=tool.tensor,
        wrist_rotation=flange_rotation @ wrist.rotation,
        wrist_origin=flange_rotation @ np.array(wrist.translation) + flange_origin,
        drive=make_drive(torque, len(scene.robot.joints)),
        bias_rate=0.0 if scene.bias_time is None else 1.0 / scene.bias_time,
        levels=stream_levels(scene, (6, len(scene.robot.joints), 6)),
    )


def carried_tool(scene: Scene) -> Inertia:
    """What is mounted on the flange, in the last link's frame; nothing at all where there is no tool."""
    if scene.tool is None:
        return Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
    return move_inertia(scene.tool.inertia, scene.robot.flange_rotation, scene.robot.flange_translation)


def carried_model(scene: Scene) -> Model:
    """Kinematics and inertia of the scene's arm, the tool joined to the last link."""
    robot = scene.robot
    weighed = scene.inertia or {}
    inertia = [weighed[x.name].inertia if x.name in weighed else x.inertia for x in robot.links]
    inertia[-1] = join_inertia(inertia[-1], carried_tool(scene))
    carried = Robot(
        name=robot.name,
        links=tuple(Link(link.name, body) for link, body in zip(robot.links, inertia, strict=True)),
        joints=robot.joints,
    )
    model = build_model(carried)
    if scene.joint_torque is not None and scene.joint_torque.rotor_inertia is not None:
        model = model._replace(rotor_inertia=np.array(scene.joint_torque.rotor_inertia))
    return model


def _surfaces(scene: Scene) -> Surfaces:
    """Primitives of all links that can be touched, at the scene's level of detail; the others have none."""
    links = list(scene.robot.links)
    if len(scene.link_names) > len(links):
        assert scene.tool is not None
        links.append(Link(scene.tool.name, scene.tool.inertia, scene.tool.primitives))
    surfaces = pack([_detailed(link, scene) for link in links])
    if len(links) > len(scene.robot.links):
        first = surfaces.start[-2]
        R, o = scene.robot.flange_rotation, scene.robot.flange_translation
        surfaces.rotation[first:] = R @ surfaces.rotation[first:]
        surfaces.origin[first:] = surfaces.origin[first:] @ R.T + o
    return surfaces


def _detailed(link: Link, scene: Scene) -> Link:
    if scene.touchable is not None and link.name not in scene.touchable:
        return Link(link.name, link.inertia)
    if scene.detail == "coarse" and link.coarse:
        return Link(link.name, link.inertia, link.coarse)
    return link


def _sensors(scene: Scene) -> Sensors:
    joints = len(scene.robot.joints)
    links = len(scene.link_names)
    base = scene.base_wrench or WrenchSensor()
    transfer = about_base(np.eye(3), np.array(base.translation))
    noise = np.array([base.force_noise] * 3 + [base.moment_noise] * 3)
    torque_noise = scene.joint_torque.noise if scene.joint_torque is not None else 1.0
    wrist = scene.wrist_wrench or WrenchSensor()
    return Sensors(
        depth=np.minimum(np.arange(links), joints).astype(np.int64),
        beyond_wrist=(np.arange(links) > joints).astype(np.int64),
        # The sensor's noise is the same in every direction, so that its orientation does not matter here.
        base_covariance=transfer @ np.diag(noise**2) @ transfer.T,
        base_information=np.linalg.inv(transfer).T @ np.diag(noise**-2.0) @ np.linalg.inv(transfer),
        torque_variance=per_joint(torque_noise, joints) ** 2,
        wrist_variance=np.array([wrist.force_noise**2, wrist.moment_noise**2]),
    )


def about_base(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """6x6 matrix that carries a wrench from a sensor's frame to base axes and the base origin.

    Args:
        rotation: Orientation of the sensor's frame in the base frame, shape (3, 3).
        translation: Its origin in the base frame, shape (3,) [m].
    """
    x, y, z = translation
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[rotation, np.zeros((3, 3))], [cross @ rotation, rotation]])


def base_wrench_from(sensor: WrenchSensor, reading: np.ndarray) -> np.ndarray:
    """Wrench of the arm on the base sensor, base axes, about the base origin, from readings in the sensor's
    own way.

    Args:
        sensor: Place, orientation and sign of the sensor.
        reading: Force and moment as the sensor gives them, shape (..., 6) [N, Nm].

    Returns:
        Shape (..., 6) [N, Nm].
    """
    sign = 1.0 if sensor.sign == "arm_on_sensor" else -1.0
    return np.asarray(
        sign * (reading - np.array(sensor.bias)) @ about_base(sensor.rotation, np.array(sensor.translation)).T
    )
