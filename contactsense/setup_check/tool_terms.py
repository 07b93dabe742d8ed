"""The wrench of a moving tool on the wrist sensor, per inertial parameter of the tool.

In the flange frame, in which the sensor rests, the momenta p and L of the tool about the flange obey

    dp/dt = m g - w x p - f,    dL/dt = m c x g - w x L - v x p - m_s,

with the flange's own velocities v and w, and the wrench (f, m_s) of the tool on the sensor. The momentum
observer low-passes that wrench without accelerations, as it does the readings.
"""

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.momentum_observer import empty_observer, start_step
from contactsense.scene import Scene


def tool_terms(scene: Scene, part: FreeMotion, bandwidth: float) -> list[np.ndarray]:
    """Low-passed wrench per inertial parameter, flange axes and origin.

    Args:
        scene: The arm.
        part: Its motion is used, its readings are not. N samples without a gap.
        bandwidth: Cut-off frequency of the observer [Hz].

    Returns:
        Four arrays of shape (N, 6, 10): per component of gravity in base axes, and for the motion alone. The
        parameters are those of `contactsense.kinematics.regressor`.
    """
    if scene.wrist_wrench is None:
        return [np.zeros((len(part.t), 6, 10))] * 4
    R, v, w = _flange_motion(scene, part)
    momentum = _momenta(v, w)
    p, L = momentum[:, :3], momentum[:, 3:]
    rate = np.concatenate((_cross(w, p), _cross(w, L) + _cross(v, p)), axis=1)
    still = np.zeros_like(momentum)
    momenta = np.stack((still, still, still, momentum), axis=1)
    drifts = np.stack((*(_weights(R[:, axis]) for axis in range(3)), -rate), axis=1)
    return list(-_low_passed(part.t, momenta, drifts, bandwidth).swapaxes(0, 1))


def _flange_motion(scene: Scene, part: FreeMotion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation of the flange, shape (N, 3, 3), and in flange axes the velocity of its origin and its
    angular velocity, shape (N, 3)."""
    robot = scene.robot
    model, motion = build_model(robot), empty_motion(len(robot.joints))
    gravity = np.zeros(3)
    count = len(part.t)
    rotation, origin, twist = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 6))
    for i, (q, qd) in enumerate(zip(part.q, part.qd, strict=True)):
        kinematics_and_momenta(model, q, qd, gravity, motion)
        rotation[i], origin[i], twist[i] = motion.rotation[-1], motion.origin[-1], motion.twist[-1]
    place = origin + rotation @ robot.flange_translation
    velocity = twist[:, :3] + np.cross(twist[:, 3:], place)
    R = rotation @ robot.flange_rotation
    v, w = (np.einsum("ni,nij->nj", vector, R) for vector in (velocity, twist[:, 3:]))
    return R, v, w


def _cross(a: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Cross product of vectors, shape (N, 3), with the columns of matrices, shape (N, 3, k)."""
    return np.asarray(np.cross(a[:, :, None], columns, axis=1))


def _momenta(v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Momenta per inertial parameter, shape (N, 6, 10), for velocities of shape (N, 3), all in body axes."""
    axes = np.broadcast_to(np.eye(3), (len(v), 3, 3))
    momentum = np.zeros((len(v), 6, 10))
    momentum[:, :3, 0] = v
    momentum[:, :3, 1:4] = _cross(w, axes)
    momentum[:, 3:, 1:4] = -_cross(v, axes)
    column = 4
    for k in range(3):
        for i in range(k + 1):
            momentum[:, 3 + i, column] = w[:, k]
            momentum[:, 3 + k, column] = w[:, i]
            column += 1
    return momentum


def _weights(down: np.ndarray) -> np.ndarray:
    """Wrenches of a unit gravity per inertial parameter, shape (N, 6, 10); `down`: its direction in body
    axes, shape (N, 3)."""
    weight = np.zeros((len(down), 6, 10))
    weight[:, :3, 0] = down
    weight[:, 3:, 1:4] = -_cross(down, np.broadcast_to(np.eye(3), (len(down), 3, 3)))
    return weight


def _low_passed(t: np.ndarray, momentum: np.ndarray, drift: np.ndarray, bandwidth: float) -> np.ndarray:
    """Residuals of the momentum observer (`contactsense.residuals.momentum_observer`) at every sample, for
    arrays of equations of shape (N, ...)."""
    steps, K = empty_observer(0), 2.0 * np.pi * bandwidth
    g = K * momentum + drift
    residual: np.ndarray = np.zeros_like(g)
    start_step(steps, 0.0, bandwidth)
    for i in range(1, len(t)):
        a, *weights, _ = start_step(steps, float(t[i] - t[i - 1]), bandwidth)
        residual[i] = a * residual[i - 1] + K * (momentum[i] - a * momentum[i - 1])
        for k, weight in enumerate(weights[: i + 1]):
            residual[i] -= weight * g[i - k]
    return residual
