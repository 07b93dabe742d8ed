"""Residuals of the force/torque sensors within the arm, and their derivatives by the parameters.

A link sensor is a base sensor of a lighter arm: of one in which only what it carries has a mass. Its reading
is moved to the base origin and passes through the same observer. The residual is then turned back into the
sensor's own frame as the parameters have it, in which noise is isotropic and a bias is constant. In the frame
that the scene states, the noise of the forces would be in the moments, times the displacement: a fit would
keep the sensor near the stated place, where the residual is smaller.
"""

from typing import NamedTuple, Self

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.calibration.calibration_model import CalibrationModel, on_time
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import Entry
from contactsense.calibration.residuals.recording_residuals import (
    residuals,
    sample_time,
    samples_of_rows,
    velocity_covariance,
)
from contactsense.calibration.residuals.residual_jacobian import Rows, difference, inertial_columns
from contactsense.calibration.residuals.smooth_velocities import with_smooth_velocities
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import empty_motion
from contactsense.robots.link_poses import link_poses
from contactsense.scene import Scene, WrenchSensor
from contactsense.scene_model.link_sensors import Mount, mounts


class _Poses(NamedTuple):
    """Orientation, shape (N, 3, 3), and origin, shape (N, 3) [m], of a moving frame in the base frame."""

    rotation: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, scene: Scene, q: np.ndarray, mount: Mount) -> Self:
        """Those of the link that carries a sensor, at joint positions of shape (N, n) [rad]."""
        poses = link_poses(scene.robot, q)[:, mount.body]
        return cls(poses[:, :3, :3], poses[:, :3, 3])

    def to_base(self, wrench: np.ndarray) -> np.ndarray:
        """Wrenches of shape (N, 6, ...) from the frame to base axes and origin."""
        force, moment = (np.einsum("nij,nj...->ni...", self.rotation, wrench[:, k : k + 3]) for k in (0, 3))
        return np.concatenate((force, moment + self._lever(force)), axis=1)

    def from_base(self, wrench: np.ndarray) -> np.ndarray:
        """The inverse of `to_base`."""
        force, moment = wrench[:, :3], wrench[:, 3:]
        parts = (force, moment - self._lever(force))
        return np.concatenate([np.einsum("nji,nj...->ni...", self.rotation, x) for x in parts], axis=1)

    def _lever(self, force: np.ndarray) -> np.ndarray:
        origin = self.origin.reshape(self.origin.shape + (1,) * (force.ndim - 2))
        return np.cross(origin, force, axis=1)


def link_residuals(
    arm: CalibrationModel,
    recording: FreeMotion,
    field: str,
    bandwidth: float,
    seen_by: CalibrationModel | None = None,
) -> np.ndarray:
    """Residual of one sensor, in its own frame, shape (N, 6) [N, Nm].

    Args:
        arm: Parameters of arm and sensors.
        recording: Contact-free motion with readings of this sensor.
        field: The sensor's key in `Scene.link_sensors`.
        bandwidth: Cut-off frequency of the observer [Hz].
        seen_by: The arm by whose parameters the frame is meant; None: `arm`.
    """
    number, mount, sensor = _of(arm.scene, field)
    link = _Poses.of(arm.scene, recording.q, mount)
    reading = on_time(recording.t, recording.link_readings[field], arm.link_delay[number])
    moved = _mounted(link, arm, field)
    part = FreeMotion(
        recording.t,
        recording.q,
        recording.qd,
        reading=sensor.sign_factor * moved.to_base(reading - arm.link_bias[number]),
        name=recording.name,
    )
    found = residuals(_carried(arm, mount), part, bandwidth)[:, recording.q.shape[1] :]
    return _mounted(link, seen_by or arm, field).from_base(found)


def link_velocity_variance(
    arm: CalibrationModel, recording: FreeMotion, field: str, bandwidth: float
) -> np.ndarray:
    """Variance of `link_residuals` due to velocities and instants of the samples, shape (N, 6) [N^2, Nm^2];
    arguments as there."""
    _, mount, _ = _of(arm.scene, field)
    covariance = velocity_covariance(_carried(arm, mount), recording, bandwidth)
    own = _mounted(_Poses.of(arm.scene, recording.q, mount), arm, field)
    # T C T^T, one side after the other.
    turned = own.from_base(own.from_base(covariance).transpose(0, 2, 1))
    return np.diagonal(turned, axis1=1, axis2=2)


def link_readings(
    arm: CalibrationModel, field: str, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray
) -> np.ndarray:
    """Readings of one sensor in motion, without noise and delay, shape (N, 6) [N, Nm].

    Args:
        arm: Parameters of arm and sensors.
        field: The sensor's key in `Scene.link_sensors`.
        q, qd, qdd: Joint positions, velocities and accelerations, shape (N, n) [rad, rad/s, rad/s^2].
    """
    number, mount, sensor = _of(arm.scene, field)
    load, state = _carried(arm, mount).model, empty_motion(q.shape[1])
    torque, wrench = np.empty(q.shape[1]), np.empty((len(q), 6))
    for i in range(len(q)):
        inverse_dynamics(load, q[i], qd[i], qdd[i], arm.gravity, state, torque, wrench[i])
    link = _Poses.of(arm.scene, q, mount)
    own = _mounted(link, arm, field).from_base(wrench)
    return np.asarray(sensor.sign_factor * own + arm.link_bias[number])


def link_rows(
    arm: CalibrationModel, recording: FreeMotion, selected: tuple[Entry, ...], bandwidth: float
) -> list[Rows]:
    """Residuals and derivatives of the equations of all sensors within the arm; arguments as for
    `contactsense.calibration.residuals.residual_jacobian.linearize`."""
    keep = samples_of_rows(recording, bandwidth)
    dt = keep.step * sample_time(recording)
    links = [(number, entry) for number, entry in enumerate(selected) if entry.group == "links"]
    smooth = with_smooth_velocities(recording)
    per_body = None
    if links and recording.link_readings:
        per_body = inertial_columns(arm, smooth, arm.gravity, bandwidth, keep)
    joints, rows = recording.q.shape[1], list[Rows]()
    for field in recording.link_readings:
        number, mount, _ = _of(arm.scene, field)
        residual = link_residuals(arm, recording, field, bandwidth)
        of_smooth = link_residuals(arm, smooth, field, bandwidth)

        def residual_of(x: CalibrationModel, part: FreeMotion, field: str = field) -> np.ndarray:
            return link_residuals(x, part, field, bandwidth, seen_by=arm)

        columns = []
        for k, entry in enumerate(selected):
            if entry.sensor == field or entry.group in ("payload", "tilt"):
                of_motion = entry.group in ("payload", "link_turn")
                part, before = (smooth, of_smooth) if of_motion else (recording, residual)
                columns.append((k, difference(residual_of, arm, part, entry, before)[keep]))
        if per_body is not None:
            link = _Poses.of(arm.scene, recording.q[keep], mount)
            own = _mounted(link, arm, field).from_base(per_body[:, joints:])
            columns += [
                (k, own[:, :, entry.index[0], entry.index[1]])
                for k, entry in links
                if entry.index[0] >= mount.first_body
            ]
        for i in range(6):
            slopes = [(k, slope[:, i]) for k, slope in columns]
            channel = joints + 6 * (number + 1) + i
            rows.append(Rows.of(channel, residual[keep, i], slopes, recording.usable[keep], dt))
    return rows


def _of(scene: Scene, field: str) -> tuple[int, Mount, WrenchSensor]:
    """Number, mount and settings of a sensor."""
    return list(scene.link_sensors).index(field), mounts(scene)[field], scene.link_sensors[field]


def _mounted(link: _Poses, arm: CalibrationModel, field: str) -> _Poses:
    """Poses of the sensor by the parameters, from those of its link."""
    number, mount, sensor = _of(arm.scene, field)
    # The frame in which the scene gives the sensor: the link's, or the flange's.
    frame = mount.rotation @ sensor.rotation.T
    turned = frame @ Rotation.from_rotvec(arm.link_turn[number]).as_matrix() @ sensor.rotation
    place = mount.origin + frame @ arm.link_shift[number]
    return _Poses(link.rotation @ turned, link.origin + link.rotation @ place)


def _carried(arm: CalibrationModel, mount: Mount) -> CalibrationModel:
    """The arm without the links that a sensor does not carry, on an ideal base sensor."""
    links = arm.links.copy()
    links[: mount.first_body] = 0.0
    return arm.with_values(
        scene=arm.scene.model_copy(update={"base_wrench": None}),
        links=links,
        wrench_bias=np.zeros(6),
        turn=np.zeros(3),
        shift=np.zeros(3),
        delay=0.0,
    )
