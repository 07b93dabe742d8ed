"""A recording as the terms of equations that are linear in what a scene states.

Rigid-body dynamics is linear in the links' inertial parameters and affine in gravity, and a low-pass filter
commutes with every constant matrix. So a recording is passed through the momentum observer once, and the
prediction of any other mounting, tool or sensor frame is a product of small matrices.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.recording_residuals import residuals
from contactsense.calibration.residual_jacobian import inertial_columns, settled_samples
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor

BANDWIDTH = 2.0
"""Cut-off frequency of the filter [Hz]: slow motion lies below it, most of the noise above."""
_INTERVAL = 0.25
"""Time between rows [s], three time constants of the filter: white noise is nearly independent between them.
"""
_MAX_ROWS = 400
"""Longer recordings have rows at larger intervals."""


@dataclass(frozen=True)
class MotionBasis:
    """Filtered terms at M instants of one or more recordings, for one arm with n joints and L links."""

    gravity: np.ndarray
    """Wrench on the base sensor and joint torques per gravity component and inertial parameter, shape (3, M,
    n + 6, L, 10): n joints, then the base wrench in base axes."""
    dynamics: np.ndarray
    """The same for the motion alone, shape (M, n + 6, L, 10)."""
    rotor: np.ndarray
    """Joint accelerations [rad/s^2], shape (M, n)."""
    coulomb: np.ndarray
    """Smooth signs of the joint velocities, shape (M, n)."""
    viscous: np.ndarray
    """Joint velocities [rad/s], shape (M, n)."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Terms of the scene's arm for a motion; the readings are not used."""
        parts = [
            _terms(scene, part, keep) for part, keep in zip(recordings, rows_of(recordings), strict=True)
        ]
        gravity, dynamics, rotor, coulomb, viscous = ([part[i] for part in parts] for i in range(5))
        return cls(
            np.concatenate(gravity, axis=1),
            np.concatenate(dynamics),
            np.concatenate(rotor),
            np.concatenate(coulomb),
            np.concatenate(viscous),
        )


class MotionBases:
    """The terms of one motion for several arms and units of the joint positions, worked out when needed."""

    def __init__(self, scenes: Mapping[str, Scene], recordings: list[FreeMotion]) -> None:
        """`scenes`: by name of the arm."""
        self._scenes, self._recordings = scenes, recordings
        self._known: dict[tuple[str, float], MotionBasis] = {}

    def of(self, robot: str, unit: float) -> MotionBasis:
        """Terms for that arm, if joint positions are in `unit` [rad]."""
        if (robot, unit) not in self._known:
            scaled = [replace(part, q=unit * part.q, qd=unit * part.qd) for part in self._recordings]
            self._known[robot, unit] = MotionBasis.of(self._scenes[robot], scaled)
        return self._known[robot, unit]


@dataclass(frozen=True)
class Readings:
    """Filtered readings at the rows of a `MotionBasis`, as they were read under the scene."""

    torque: np.ndarray | None
    """Joint torques, shape (M, n) [Nm]."""
    wrench: tuple["_Track", ...]
    """Base sensor, one track per recording; empty without one."""
    variance_ratio: float
    """Variance of filtered over that of single samples, for white noise."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Filtered readings of all recordings; a sensor counts only if every recording has it."""
        keep = rows_of(recordings)
        filtered = [residuals(_massless(scene), part, BANDWIDTH) for part in recordings]
        torque, tracks = None, []
        n = recordings[0].q.shape[1]
        if all(part.torque is not None for part in recordings):
            torque = np.concatenate([-f[k, :n] for f, k in zip(filtered, keep, strict=True)])
        if all(part.reading is not None for part in recordings):
            tracks = [
                _Track(part.t, f[:, n:], part.t[k])
                for part, f, k in zip(recordings, filtered, keep, strict=True)
            ]
        dt = float(np.median(np.concatenate([np.diff(part.t) for part in recordings])))
        return cls(torque, tuple(tracks), noise_variance_ratio(BANDWIDTH, dt))

    def wrench_at(self, delay: float) -> np.ndarray:
        """Readings of the base sensor that arrived `delay` [s] after each row, shape (M, 6) [N, Nm]."""
        return np.concatenate([track.at(delay) for track in self.wrench])


@dataclass(frozen=True)
class _Track:
    t: np.ndarray
    values: np.ndarray
    rows: np.ndarray

    def at(self, delay: float) -> np.ndarray:
        return np.column_stack([np.interp(self.rows + delay, self.t, column) for column in self.values.T])


def rows_of(recordings: list[FreeMotion]) -> list[slice]:
    """Samples of each recording that are used."""
    interval = max(_INTERVAL, sum(part.seconds for part in recordings) / _MAX_ROWS)
    return [
        slice(
            settled_samples(part, BANDWIDTH),
            None,
            max(1, round(interval / float(np.median(np.diff(part.t))))),
        )
        for part in recordings
    ]


def _massless(scene: Scene) -> CalibrationModel:
    """An arm without mass and friction with sensors in base axes: its residuals are the filtered readings."""
    plain = scene.model_copy(
        update={"base_wrench": WrenchSensor(), "joint_torque": JointTorqueSensor(), "tool": None}
    )
    arm = CalibrationModel.of(plain)
    return arm.with_values(links=np.zeros_like(arm.links), rotor=np.zeros_like(arm.rotor))


def _terms(scene: Scene, part: FreeMotion, keep: slice) -> tuple[np.ndarray, ...]:
    n = part.q.shape[1]
    arm = _massless(scene)
    # The observer's residual is model minus measurement for joints, the reverse for the base.
    sign = np.concatenate((np.ones(n), -np.ones(6)))[:, None, None]
    dynamics = sign * inertial_columns(arm, part, np.zeros(3), BANDWIDTH, keep)
    gravity = np.array(
        [sign * inertial_columns(arm, part, axis, BANDWIDTH, keep) - dynamics for axis in np.eye(3)]
    )
    still = replace(part, torque=np.zeros_like(part.q), reading=None)
    ones = np.ones(n)
    friction = (
        residuals(arm.with_values(**{name: ones}), still, BANDWIDTH)[keep, :n]
        for name in ("rotor", "coulomb", "viscous")
    )
    return gravity, dynamics, *friction
