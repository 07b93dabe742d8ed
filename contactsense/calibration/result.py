"""What calibration found: values with their uncertainty, residuals before and after, warnings, a scene."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.calibration.parameters import Entry
from contactsense.calibration.plant import Plant
from contactsense.calibration.spread import Spread
from contactsense.scene import Scene
from contactsense.sensing import (
    Friction,
    JointTorqueSensor,
    LinkInertia,
    WrenchSensor,
)
from kinematics.regressor import bodies_of
from robots.tool import Tool

_DIGITS = 6


@dataclass(frozen=True)
class Value:
    """One parameter: what the scene said, what was found."""

    entry: Entry
    before: float
    after: float
    std: float
    """Standard deviation of `after`; 0 where the parameter was kept."""
    kept: str = ""
    """Why the scene's value was kept; empty where the parameter was estimated."""


@dataclass(frozen=True)
class Level:
    """How large a residual is."""

    rms: np.ndarray
    """Root mean square of each channel, shape (n + 6,): joints [Nm], base wrench [N, Nm]; NaN without
    sensor."""
    tail: np.ndarray
    """What 99.9 % of its absolute values stay below, shape (n + 6,)."""


@dataclass(frozen=True)
class Calibration:
    """All that one calibration found."""

    scene: Scene
    """The scene with everything that was found."""
    values: tuple[Value, ...]
    """All parameters that were looked at, but the links' inertia."""
    inertia: tuple[Value, ...]
    """The links' inertial parameters, where they were looked at: only some combinations of them can be seen,
    the rest is the prior's."""
    warnings: tuple[str, ...]
    """What the motion did not tell, and what looks wrong; one sentence each."""
    before: Level
    """Residuals under the scene that came in."""
    after: Level
    """Residuals under `scene`."""
    condition: float
    """Condition number of the scaled regressor of all that was estimated."""
    covariance: np.ndarray
    """Covariance of `values` and `inertia`, in their order."""


def level(residual: list[np.ndarray], present: np.ndarray) -> Level:
    """RMS and tail of residuals of shape (N, n + 6) each."""
    all_ = np.vstack(residual)
    rms, tail = np.sqrt(np.mean(all_**2, axis=0)), np.quantile(np.abs(all_), 0.999, axis=0)
    return Level(np.where(present, rms, np.nan), np.where(present, tail, np.nan))


def scene_of(plant: Plant, changed: set[str], spread: Spread | None, wrench: tuple[float, float]) -> Scene:
    """The plant's scene, with the plant's numbers.

    Args:
        plant: What was found.
        changed: Groups of which anything was estimated.
        spread: Noise and model error of the joint torques; None without them.
        wrench: Noise of force and moment of the base sensor; NaN without it.
    """
    scene = plant.scene
    update: dict[str, object] = {}
    if scene.joint_torque is not None and spread is not None:
        update["joint_torque"] = _torque(plant, scene.joint_torque, changed, spread)
    if scene.base_wrench is not None and np.isfinite(wrench[0]):
        update["base_wrench"] = _wrench(plant, scene.base_wrench, wrench)
    if "tilt" in changed:
        update["mounting"] = _mounting(plant)
    if "payload" in changed:
        tool = scene.tool or Tool()
        mass = max(float(plant.payload[0]), 0.0)
        com = tuple(_round(plant.payload[1:] / mass)) if mass > 0.0 else (0.0, 0.0, 0.0)
        update["tool"] = tool.model_copy(update={"mass": _round(np.array([mass]))[0], "com": com})
    if "links" in changed:
        masses, coms, tensors = bodies_of(plant.links)
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


def _torque(plant: Plant, sensor: JointTorqueSensor, changed: set[str], spread: Spread) -> JointTorqueSensor:
    coulomb = _round(plant.coulomb)
    unseen = np.isnan(spread.rest_error)
    # A joint at rest holds anything between plus and minus Coulomb friction.
    rest = np.where(unseen, plant.coulomb / np.sqrt(3.0), spread.rest_error)
    friction = Friction(
        coulomb=tuple(coulomb),
        load=tuple(_round(plant.load)),
        viscous=tuple(_round(plant.viscous)),
        lubricant=tuple(_round(plant.lubricant)),
        velocity=plant.velocity,
        lubricant_velocity=plant.lubricant_velocity,
        error=tuple(_round(spread.friction_error)),
        rest_error=tuple(_round(rest)),
        rest_velocity=spread.rest_velocity,
    )
    update: dict[str, object] = {
        "friction": friction,
        "bias": tuple(_round(plant.bias)),
        "rotor_inertia": tuple(_round(plant.rotor)),
        "noise": tuple(_round(spread.noise)),
        "model_error": tuple(_round(spread.model_error)),
    }
    if "gain" in changed:
        joints = plant.scene.robot.joints
        known = sensor.torque_constants or tuple(joint.torque_constant or 1.0 for joint in joints)
        update["torque_constants"] = tuple(_round(plant.gain * np.array(known)))
    return sensor.model_copy(update=update)


def _wrench(plant: Plant, sensor: WrenchSensor, noise: tuple[float, float]) -> WrenchSensor:
    turned = Rotation.from_rotvec(plant.turn) * Rotation.from_matrix(sensor.rotation)
    return sensor.model_copy(
        update={
            "bias": tuple(_round(plant.wrench_bias)),
            "delay": _round(np.array([plant.delay]))[0],
            "rpy": tuple(_round(turned.as_euler("xyz"))) if plant.turn.any() else sensor.rpy,
            "translation": tuple(_round(np.array(sensor.translation) + plant.shift)),
            "force_noise": _round(np.array(noise))[0],
            "moment_noise": _round(np.array(noise))[1],
        }
    )


def _mounting(plant: Plant) -> tuple[float, ...]:
    """Roll, pitch, yaw of the base in the world, such that gravity comes out as found."""
    stands = plant.scene.orientation * Rotation.from_rotvec(plant.tilt).inv()
    return tuple(_round(stands.as_euler("xyz")))
