"""Warnings of a scene whose numbers are possible but not those of its arm; limits are the arm's data."""

from collections.abc import Iterator
from math import isfinite

import numpy as np

from contactsense.plausibility.largest_reading import RAMP_TIME, largest_torque_at_rest
from contactsense.robots.library import in_library
from contactsense.robots.principal_moments import check_principal_moments
from contactsense.scene import Scene
from contactsense.sensors.field_checks import of_its_mass
from contactsense.sensors.settings import WrenchSensor, per_joint

_OTHER_MASS = 2.0
"""A link whose mass differs from the robot's data by more than this factor is another link."""
_OTHER_UNIT = 10.0
"""A link whose largest principal moment differs from the robot's data by more than this factor is
probably in another unit."""


def weightless_tool(scene: Scene) -> Iterator[str]:
    """What is stated of a tool that has a surface but no mass, as `contactsense decompose` leaves that of a
    mesh; one line at most. A calibration may find next to none."""
    if scene.tool is not None and scene.tool.primitives and scene.tool.mass == 0.0:
        yield "tool.mass: expected the mass of a tool that has a surface, got 0 kg"


def load_warnings(scene: Scene) -> Iterator[str]:
    """What is stated of loads, drives and noise beyond what the arm's data allow, one line each."""
    yield from _masses(scene)
    yield from tensor_warnings(scene)
    yield from _arm_tensors(scene)
    yield from _torques(scene)
    yield from _drives(scene)
    if scene.base_wrench is not None:
        yield from _noise(scene, "base_wrench", scene.base_wrench)
    for field, sensor in scene.link_sensors.items():
        yield from _noise(scene, field, sensor)


def _masses(scene: Scene) -> Iterator[str]:
    """Links whose stated mass is far from the robot's data."""
    for link in scene.robot.links:
        stated, known = (scene.inertia or {}).get(link.name), link.inertia.mass
        if stated is not None and known > 0.0 and not 1.0 / _OTHER_MASS < stated.mass / known < _OTHER_MASS:
            yield (
                f"inertia.{link.name}.mass: expected about the {known:.3g} kg of the robot's data, "
                f"got {stated.mass:.3g} kg"
            )


def tensor_warnings(scene: Scene) -> Iterator[str]:
    """Inertia of links that no body has, or that is far from the robot's data, one line each.

    A scene may have such an inertia, as calibrations of links once stated it.
    """
    for link in scene.robot.links:
        stated = (scene.inertia or {}).get(link.name)
        if stated is None:
            continue
        try:
            check_principal_moments(stated.inertia.tensor)
        except ValueError as error:
            yield (
                f"inertia.{link.name}.tensor: {error}; `contactsense calibrate --links` writes that of a body"
            )
            continue
        own, known = (float(np.linalg.eigvalsh(i.tensor)[2]) for i in (stated.inertia, link.inertia))
        if own > 0.0 and known > 0.0 and not 1.0 / _OTHER_UNIT < own / known < _OTHER_UNIT:
            yield (
                f"inertia.{link.name}.tensor: expected a largest principal moment of about the {known:.3g} "
                f"kg m^2 of the robot's data, got {own:.3g} kg m^2"
            )


def _arm_tensors(scene: Scene) -> Iterator[str]:
    """Inertia of moving links in the arm's own data that is in another unit, as exporters of URDFs use."""
    for link in scene.robot.links[1:]:
        if link.name in (scene.inertia or {}):
            continue
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia.tensor.tolist()
        try:
            of_its_mass(link.inertia.mass, (xx, xy, xz, yy, yz, zz))
        except ValueError as error:
            yield f"robot: link {link.name}: inertia: {error}"


def _torques(scene: Scene) -> Iterator[str]:
    """Joints that cannot hold arm and tool in some posture. Those of a known arm can hold the arm itself."""
    if scene.tool is None and scene.inertia is None and in_library(scene.robot):
        return
    joints = scene.robot.joints
    largest = largest_torque_at_rest(scene)
    limits = np.array([joint.torque_limit for joint in joints])
    worst = int(np.argmax(largest / limits))
    if largest[worst] > limits[worst]:
        field = "robot" if scene.inertia is None else "inertia"
        if scene.tool is not None and scene.tool.mass > 0.0:
            field = "tool"
        yield (
            f"{field}: expected a weight that {joints[worst].name} can hold ({limits[worst]:.3g} Nm), got "
            f"{largest[worst]:.3g} Nm in some posture"
        )


def _drives(scene: Scene) -> Iterator[str]:
    """Noise, friction and rotors that leave nothing of a joint's largest torque."""
    sensor, joints = scene.joint_torque, scene.robot.joints
    if sensor is None:
        return
    limits = np.array([joint.torque_limit for joint in joints])
    # Nothing follows from a speed that is not known.
    speeds = np.array([joint.velocity_limit if isfinite(joint.velocity_limit) else 0.0 for joint in joints])
    rotors = sensor.rotor_inertia or tuple(joint.rotor_inertia for joint in joints)
    torques = {
        "noise": ("a noise", per_joint(sensor.noise, len(joints))),
        "model_error": ("an error", per_joint(sensor.model_error, len(joints))),
        "friction.viscous": (
            "a friction at the largest speed",
            speeds * per_joint(sensor.friction.viscous, len(joints)),
        ),
        "rotor_inertia": (
            f"a torque to the largest speed within {RAMP_TIME:g} s",
            speeds / RAMP_TIME * np.array(rotors),
        ),
    }
    for field, (what, torque) in torques.items():
        for j in np.flatnonzero(torque >= limits)[:1]:
            yield (
                f"joint_torque.{field}: expected {what} below the {limits[j]:g} Nm of {joints[j].name}, "
                f"got {torque[j]:.3g} Nm"
            )


def _noise(scene: Scene, field: str, sensor: WrenchSensor) -> Iterator[str]:
    """A sensor whose noise is more than all that it could carry."""
    weight = scene.gravity * (scene.robot.mass + scene.tool_inertia.mass)
    reach = sum(float(np.linalg.norm(joint.translation)) for joint in scene.robot.joints)
    for name, noise, limit, unit in (
        ("force_noise", sensor.force_noise, weight, "N"),
        ("moment_noise", sensor.moment_noise, weight * reach, "Nm"),
    ):
        if weight > 0.0 and noise >= limit:
            yield (
                f"{field}.{name}: expected less than the arm's own weight causes ({limit:.3g} {unit}), got "
                f"{noise:g} {unit}: contacts cannot be detected"
            )
