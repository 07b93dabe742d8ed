"""Residuals of whole recordings by the momentum observer: the errors that calibration minimizes."""

from typing import NamedTuple

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.kinematics.composite_inertia import unit_momenta_of_arm
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, Motion, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.spatial import dot6
from contactsense.residuals.equations_of_motion import observe_joints, observe_wrench
from contactsense.residuals.inertia_torque import InertiaTorque, follow_inertia_torque
from contactsense.residuals.joint_friction import JointTorqueModel, friction_torque
from contactsense.residuals.momentum_observer import MomentumObserver, empty_observer
from contactsense.residuals.timing_error import TimingError, advance_timing_error
from contactsense.residuals.velocity_noise import VelocityNoise, follow_velocity_noise
from contactsense.residuals.wrench_velocity_error import WrenchVelocityError, advance_wrench_velocity_error
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.kernel import kernel

GAP = 0.05
"""After a longer gap between two samples the observer restarts [s]."""
_ROWS_PER_PERIOD = 10.0
"""Rows kept per second and hertz of bandwidth; more are redundant."""
_STANDSTILL = 0.5
_STANDSTILL_PATH = 2e-3
"""A joint that has moved less than this [rad] within `_STANDSTILL` seconds is at rest."""


class Dynamics(NamedTuple):
    """An arm in the form that the kernels use."""

    model: Model
    torque_model: JointTorqueModel
    gravity: np.ndarray
    """Base axes, shape (3,) [m/s^2]."""
    motion: Motion
    """Scratch: kinematics and momenta at one sample."""


class JointMotion(NamedTuple):
    """N samples of the motion of n joints."""

    t: np.ndarray
    """Time [s], shape (N,)."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    qd: np.ndarray
    """Joint velocities [rad/s], shape (N, n)."""


@kernel
def time_step(t: np.ndarray, i: int) -> float:
    """Time since the previous sample [s]; 0, which restarts the observer, at the first one and after a
    gap."""
    dt = 0.0 if i == 0 else t[i] - t[i - 1]
    return 0.0 if dt > GAP else dt


@kernel
def _observe(
    arm: Dynamics,
    joints: JointMotion,
    torque: np.ndarray,
    wrench: np.ndarray,
    bandwidth: float,
    joint_observer: MomentumObserver,
    base_observer: MomentumObserver,
    out: np.ndarray,
) -> None:
    motion, n = arm.motion, joints.q.shape[1]
    for i in range(joints.t.shape[0]):
        dt, qd = time_step(joints.t, i), joints.qd[i]
        kinematics_and_momenta(arm.model, joints.q[i], qd, arm.gravity, motion)
        if torque.shape[0] > 0:
            observe_joints(arm.model, arm.torque_model, motion, qd, torque[i], dt, bandwidth, joint_observer)
            copy(joint_observer.residual, out[i, :n])
        if wrench.shape[0] > 0:
            observe_wrench(motion.momentum[0], motion.gravity[0], wrench[i], dt, bandwidth, base_observer)
            copy(base_observer.residual, out[i, n:])


def residuals(
    arm: CalibrationModel, recording: FreeMotion, bandwidth: float, about: CalibrationModel | None = None
) -> np.ndarray:
    """Residuals of joints and base, as a `Localizer` of that scene computes them, but that of the base about
    its sensor.

    About the base origin, the noise of the forces would be in the moments, times the distance of the sensor:
    a fit would move the sensor towards the origin, where the residual is smaller.

    Args:
        arm: Parameters of arm and sensors.
        recording: Contact-free motion.
        bandwidth: Cut-off frequency of the observer [Hz].
        about: The arm by whose parameters the place of the base sensor is meant; None: `arm`.

    Returns:
        Shape (N, n + 6): n joints [Nm], then the wrench on the base, base axes, about the place of its sensor
        [N, Nm]; zeros for a missing sensor.
    """
    n = recording.q.shape[1]
    none = np.empty((0, 1))
    torque = none if recording.torque is None else recording.torque * arm.gain
    wrench = none if recording.reading is None else arm.base_wrench(recording.t, recording.reading)
    out = np.zeros((len(recording.t), n + 6))
    _observe(
        Dynamics(arm.model, arm.torque_model, arm.gravity, empty_motion(n)),
        JointMotion(recording.t, recording.q, recording.qd),
        torque, wrench, bandwidth, empty_observer(n), empty_observer(6), out,
    )  # fmt: skip
    out[:, n:] = out[:, n:] @ (about or arm).to_base_sensor.T
    return out


@kernel
def _friction_of_rows(
    arm: Dynamics,
    q: np.ndarray,
    qd: np.ndarray,
    out: np.ndarray,
) -> None:
    motion = arm.motion
    for i in range(q.shape[0]):
        kinematics_and_momenta(arm.model, q[i], qd[i], arm.gravity, motion)
        for j in range(q.shape[1]):
            out[i, j] = friction_torque(
                arm.torque_model, j, qd[i, j], dot6(motion.screw[j], motion.gravity[j + 1])
            )


def friction(arm: CalibrationModel, recording: FreeMotion) -> np.ndarray:
    """Friction torque of the model at every sample, shape (N, n) [Nm]."""
    out = np.empty_like(recording.q)
    dynamics = Dynamics(arm.model, arm.torque_model, arm.gravity, empty_motion(recording.q.shape[1]))
    _friction_of_rows(dynamics, recording.q, recording.qd, out)
    return out


@kernel
def _follow_momenta(
    arm: Dynamics,
    joints: JointMotion,
    bandwidth: float,
    observer: MomentumObserver,
    timing_error: TimingError,
    inertia_torque: InertiaTorque,
    out: np.ndarray,
) -> None:
    motion = arm.motion
    for i in range(joints.t.shape[0]):
        dt, qd = time_step(joints.t, i), joints.qd[i]
        kinematics_and_momenta(arm.model, joints.q[i], qd, arm.gravity, motion)
        # The torque does not matter: only the momenta of the observer are used.
        observe_joints(arm.model, arm.torque_model, motion, qd, qd, dt, bandwidth, observer)
        advance_timing_error(timing_error, observer.momentum, dt, bandwidth)
        follow_inertia_torque(inertia_torque, timing_error.rate, dt, bandwidth)
        copy(timing_error.variance, out[0, i])
        copy(inertia_torque.present, out[1, i])


def timing_variance_and_inertia_torque(
    arm: CalibrationModel, recording: FreeMotion, bandwidth: float
) -> tuple[np.ndarray, np.ndarray]:
    """What a stream knows of the errors of its residuals at every sample, arguments as for `residuals`:
    variance of each joint's residual due to the instants of the samples
    (`contactsense.residuals.timing_error`) [Nm^2], and inertia torque, low-passed as the residual is
    (`contactsense.residuals.inertia_torque`) [Nm]; shape (N, n) each."""
    n = recording.q.shape[1]
    out = np.empty((2, *recording.q.shape))
    _follow_momenta(
        Dynamics(arm.model, arm.torque_model, arm.gravity, empty_motion(n)),
        JointMotion(recording.t, recording.q, recording.qd), bandwidth, empty_observer(n),
        zeros(TimingError, joints=n), zeros(InertiaTorque, joints=n), out,
    )  # fmt: skip
    return out[0], out[1]


@kernel
def _follow_velocities(
    arm: Dynamics,
    joints: JointMotion,
    bandwidth: float,
    velocities: VelocityNoise,
    error: WrenchVelocityError,
    out: np.ndarray,
) -> None:
    motion = arm.motion
    for i in range(joints.t.shape[0]):
        dt = time_step(joints.t, i)
        if follow_velocity_noise(velocities, joints.qd[i], dt):
            forward_kinematics(arm.model, joints.q[i], motion)
            unit_momenta_of_arm(arm.model, motion, error.unit_momentum)
        advance_wrench_velocity_error(error, velocities, dt, bandwidth)
        for k in range(6):
            for m in range(6):
                out[i, k, m] = error.noise[k, m] + error.instants[k, m]


def velocity_covariance(arm: CalibrationModel, recording: FreeMotion, bandwidth: float) -> np.ndarray:
    """What a stream knows of the errors of the residual of a force/torque sensor that carries the whole arm,
    due to the joint velocities (`contactsense.residuals.wrench_velocity_error`).

    Returns:
        Covariance at every sample, base axes, about the base origin, shape (N, 6, 6) [N^2, N Nm, Nm^2].
    """
    n = recording.q.shape[1]
    out = np.empty((len(recording.t), 6, 6))
    _follow_velocities(
        Dynamics(arm.model, arm.torque_model, arm.gravity, empty_motion(n)),
        JointMotion(recording.t, recording.q, recording.qd), bandwidth,
        zeros(VelocityNoise, joints=n), zeros(WrenchVelocityError, joints=n), out,
    )  # fmt: skip
    return out


def settled_samples(recording: FreeMotion, bandwidth: float) -> int:
    """First sample at which the observer has settled after its start."""
    return int(np.searchsorted(recording.t, recording.t[0] + 5.0 / (2.0 * np.pi * bandwidth)))


def samples_of_rows(recording: FreeMotion, bandwidth: float) -> slice:
    """The samples whose residuals are the rows of a fit: filtered residuals change slowly, and samples in
    between are redundant. Each recording has its own step: one that is slower has no samples to spare."""
    # A whole number of hertz: half of a step is rounded the same way wherever the clock begins.
    rate = round(1.0 / sample_time(recording))
    stride = max(1, round(rate / (_ROWS_PER_PERIOD * bandwidth)))
    return slice(settled_samples(recording, bandwidth), None, stride)


def sample_time(recording: FreeMotion) -> float:
    """Usual time between two samples [s]."""
    return float(np.median(np.diff(recording.t)))


def recently_moved(recording: FreeMotion) -> np.ndarray:
    """Whether each joint has moved within the last half second, shape (N, n), bool.

    A joint at rest holds any torque up to Coulomb friction: its samples carry no information on friction.
    """
    ago = np.searchsorted(recording.t, recording.t - _STANDSTILL)
    path = np.vstack(
        (np.zeros(recording.q.shape[1]), np.cumsum(np.abs(np.diff(recording.q, axis=0)), axis=0))
    )
    return np.asarray(path - path[ago] > _STANDSTILL_PATH)
