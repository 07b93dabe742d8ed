"""Result of a calibration: values with uncertainty, residuals before and after, warnings, and a scene."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.calibration.calibration_model import MIN_TOOL_MASS, CalibrationModel
from contactsense.calibration.contacts.contact_test import SuspectedContact
from contactsense.calibration.noise.noise_estimation import NoiseLevels
from contactsense.calibration.parameters import Entry
from contactsense.kinematics.regressor import bodies_of
from contactsense.robots.rotations import rpy_from_rotation
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.sensors.settings import (
    Friction,
    JointTorqueSensor,
    LinkInertia,
    WrenchSensor,
)

_DIGITS = 6
"""Significant digits of the numbers in a scene file."""
CHANGED = 2.0
"""A parameter has changed if it moved by this many standard deviations."""


@dataclass(frozen=True)
class Value:
    """One parameter: the scene's value and the estimate."""

    entry: Entry
    before: float
    after: float
    std: float
    """Standard deviation of `after`; 0 if the parameter was kept."""
    kept: str = ""
    """Why the scene's value was kept; empty if the parameter was estimated."""

    @property
    def changed(self) -> bool:
        """Whether the estimate differs significantly from the scene's value, which it confirms otherwise."""
        return abs(self.after - self.before) > CHANGED * self.std


@dataclass(frozen=True)
class ResidualStatistics:
    """Size of a residual."""

    rms: np.ndarray
    """Root mean square of each of C equations (`contactsense.calibration.residuals.equations`), shape (C,):
    joints [Nm], base wrench about its sensor [N, Nm], wrench of each sensor within the arm; NaN without
    sensor."""
    tail: np.ndarray
    """99.9 % quantile of the absolute values, shape (C,)."""


@dataclass(frozen=True)
class Calibration:
    """Result of one calibration."""

    scene: Scene
    """The scene with all estimates."""
    values: tuple[Value, ...]
    """All selected parameters except the links' inertia."""
    inertia: tuple[Value, ...]
    """The links' inertial parameters, if selected: only some combinations are identifiable, the others follow
    the prior."""
    warnings: tuple[str, ...]
    """Parameters that the motion does not excite, and suspected errors; one sentence each."""
    before: ResidualStatistics
    """Residuals with the original scene."""
    after: ResidualStatistics
    """Residuals with `scene`."""
    unconstrained: ResidualStatistics
    """Residuals of the best estimate, in which the inertia of `constrained` is that of no body."""
    constrained: tuple[str, ...]
    """Links whose inertia was changed to that of a body."""
    condition: float
    """Condition number of the scaled regressor of the estimated parameters."""
    covariance: np.ndarray
    """Covariance of `values` and `inertia`, in their order."""
    contacts: tuple[SuspectedContact, ...]
    """Stretches that were left out because something seems to push on the arm."""
    seconds: float
    """Motion that was used [s]."""


def residual_statistics(residuals: list[np.ndarray], measured: list[np.ndarray]) -> ResidualStatistics:
    """RMS and tail of the residuals of each equation, over the recordings that have its sensor.

    Args:
        residuals: Of each recording, shape (N, C).
        measured: Which of the equations each recording has a sensor for, shape (C,), bool.
    """
    count = len(measured[0])
    rms, tail = np.full(count, np.nan), np.full(count, np.nan)
    for c in range(count):
        own = [residual[:, c] for residual, there in zip(residuals, measured, strict=True) if there[c]]
        if own:
            values = np.concatenate(own)
            rms[c], tail[c] = np.sqrt(np.mean(values**2)), np.quantile(np.abs(values), 0.999)
    return ResidualStatistics(rms, tail)


def scene_of(
    arm: CalibrationModel,
    changed: set[str],
    noise_levels: NoiseLevels | None,
    wrenches: Mapping[str, tuple[float, float]],
) -> Scene:
    """The original scene with the estimated values.

    Args:
        arm: The estimates.
        changed: Groups with at least one estimated parameter.
        noise_levels: Noise and model error of the joint torques; None without them.
        wrenches: Noise of force and moment [N, Nm] of each force/torque sensor that was recorded, by field.
    """
    scene = arm.scene
    update: dict[str, object] = {}
    if scene.joint_torque is not None and noise_levels is not None:
        update["joint_torque"] = _torque(arm, scene.joint_torque, changed, noise_levels)
    sensors = {field: _wrench(arm, field, noise) for field, noise in wrenches.items()}
    update |= {field: sensors[field] for field in ("base_wrench", "wrist_wrench") if field in sensors}
    update["link_wrenches"] = tuple(
        sensors.get(f"link_wrenches.{sensor.name}", sensor) for sensor in scene.link_wrenches
    )
    if "tilt" in changed:
        update["mounting"] = _mounting(arm)
    if "payload" in changed:
        mass = max(float(arm.payload[0]), 0.0)
        tool = scene.tool or (Tool() if mass > MIN_TOOL_MASS else None)
        if tool is not None:
            # Where next to no mass is, its place is that of the noise.
            com = tuple(_round(arm.payload[1:] / mass)) if mass > MIN_TOOL_MASS else tool.com
            update["tool"] = tool.model_copy(update={"mass": _round(np.array([mass]))[0], "com": com})
    if "links" in changed:
        masses, coms, tensors = bodies_of(arm.links)
        update["inertia"] = {
            link.name: LinkInertia(
                mass=max(_round(masses[k : k + 1])[0], 0.0),
                com=tuple(_round(coms[k])),
                tensor=tuple(_round(tensors[k][np.triu_indices(3)])),
            )
            for k, link in enumerate(scene.robot.links)
            if k > 0
        }
    return scene.model_copy(update=update)


def _round(values: np.ndarray) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _torque(
    arm: CalibrationModel, sensor: JointTorqueSensor, changed: set[str], noise_levels: NoiseLevels
) -> JointTorqueSensor:
    coulomb = _round(arm.coulomb)
    never_at_rest = np.isnan(noise_levels.rest_error)
    # A joint at rest holds any torque between plus and minus Coulomb friction.
    rest = np.where(never_at_rest, arm.coulomb / np.sqrt(3.0), noise_levels.rest_error)
    friction = Friction(
        coulomb=tuple(coulomb),
        load=tuple(_round(arm.load)),
        viscous=tuple(_round(arm.viscous)),
        lubricant=tuple(_round(arm.lubricant)),
        velocity=arm.velocity,
        lubricant_velocity=arm.lubricant_velocity,
        error=tuple(_round(noise_levels.friction_error)),
        rest_error=tuple(_round(rest)),
        rest_velocity=noise_levels.rest_velocity,
    )
    update: dict[str, object] = {
        "friction": friction,
        "bias": tuple(_round(arm.bias)),
        "rotor_inertia": tuple(_round(arm.rotor)),
        "noise": tuple(_round(noise_levels.noise)),
        "model_error": tuple(_round(noise_levels.model_error)),
        "inertia_torque_error": tuple(_round(noise_levels.inertia_torque_error)),
        "average_error": tuple(_round(noise_levels.average_error)),
    }
    if "gain" in changed:
        joints = arm.scene.robot.joints
        known = sensor.torque_constants or tuple(joint.torque_constant or 1.0 for joint in joints)
        update["torque_constants"] = tuple(_round(arm.gain * np.array(known)))
    return sensor.model_copy(update=update)


def _wrench(arm: CalibrationModel, field: str, noise: tuple[float, float]) -> WrenchSensor:
    """The sensor with its estimates."""
    sensor: WrenchSensor | None = arm.scene.base_wrench
    bias, turn, shift, delay = arm.wrench_bias, arm.turn, arm.shift, arm.delay
    if field != "base_wrench":
        number, sensor = list(arm.scene.link_sensors).index(field), arm.scene.link_sensors[field]
        arrays = (arm.link_bias, arm.link_turn, arm.link_shift, arm.link_delay)
        bias, turn, shift, delay = (array[number] for array in arrays)
    assert sensor is not None
    turned = Rotation.from_rotvec(turn) * Rotation.from_matrix(sensor.rotation)
    return sensor.model_copy(
        update={
            "bias": tuple(_round(bias)),
            "delay": _round(np.array([delay]))[0],
            "rpy": tuple(_round(np.array(rpy_from_rotation(turned.as_matrix()))))
            if turn.any()
            else sensor.rpy,
            "translation": tuple(_round(np.array(sensor.translation) + shift)),
            "force_noise": _round(np.array(noise))[0],
            "moment_noise": _round(np.array(noise))[1],
        }
    )


def _mounting(arm: CalibrationModel) -> tuple[float, ...]:
    """Roll, pitch, yaw of the base in the world that give the estimated direction of gravity and are nearest
    to the scene's: a turn about gravity is not observable, and none is added."""
    stated, estimated = arm.scene.gravity_base, arm.gravity
    axis = np.cross(stated, estimated)
    sine = float(np.linalg.norm(axis))
    tilt = Rotation.from_rotvec(axis * (np.arctan2(sine, stated @ estimated) / sine if sine > 0.0 else 0.0))
    orientation = arm.scene.orientation * tilt.inv()
    return tuple(_round(np.array(rpy_from_rotation(orientation.as_matrix()))))
