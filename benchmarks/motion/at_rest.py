"""The same contacts on an arm at rest: the reference for the effect of motion."""

import numpy as np

from contactsense import Batch, JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.benchmarks.motion.streams import Stream
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion


def with_noise_scaled(scene: Scene, factor: float) -> Scene:
    """The scene with sensors of `factor` times the noise, and no other error."""
    base, torque = scene.base_wrench, scene.joint_torque
    return scene.model_copy(
        update={
            "base_wrench": base
            and WrenchSensor(force_noise=factor * base.force_noise, moment_noise=factor * base.moment_noise),
            "joint_torque": torque and JointTorqueSensor(noise=factor * np.asarray(torque.noise).item()),
        }
    )


def locate_at_rest(
    localizer: Localizer,
    rows: list[tuple[Stream, int]],
    noise: tuple[float, float, float],
    sensors: tuple[bool, bool] = (True, True),
) -> Batch:
    """Locate the contact of each sample from its posture and its true wrench, with added noise.

    Args:
        localizer: For a scene with the true noise of the sensors.
        rows: Samples as (stream, number).
        noise: Standard deviations of base force, base moment and joint torque [N, Nm, Nm].
        sensors: Whether there are base sensor and joint torques.
    """
    joints = len(localizer.scene.robot.joints)
    model, motion = build_model(localizer.scene.robot), empty_motion(joints)
    q = np.array([stream.q[i] for stream, i in rows])
    wrench = np.array([stream.wrench[i] for stream, i in rows])
    link = np.array([stream.link[i] for stream, i in rows])
    torque = np.empty((len(rows), joints))
    for row in range(len(rows)):
        forward_kinematics(model, q[row], motion)
        torque[row] = np.where(np.arange(joints) < link[row], -motion.screw @ wrench[row], 0.0)
    reading = wrench + np.array([stream.noise_wrench[i] for stream, i in rows]) * np.repeat(noise[:2], 3)
    torque += np.array([stream.noise_torque[i] for stream, i in rows]) * noise[2]
    return localizer.locate_batch(
        q,
        base_wrench=reading if sensors[0] else None,
        joint_torque=torque if sensors[1] else None,
        detect=False,
    )


def static_error(
    localizer: Localizer,
    rows: list[tuple[Stream, int]],
    noise: tuple[float, float, float],
    sensors: tuple[bool, bool] = (True, True),
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of `locate_at_rest`, whose arguments these are.

    Returns:
        Distance of each answer from the truth, shape (N,) [m], infinite if there is none; whether the link is
        correct, shape (N,).
    """
    batch = locate_at_rest(localizer, rows, noise, sensors)
    error = np.linalg.norm(batch.point_base - np.array([s.point_base[i] for s, i in rows]), axis=1)
    error[batch.link < 0] = np.inf
    return error, batch.link == np.array([stream.link[i] for stream, i in rows])
