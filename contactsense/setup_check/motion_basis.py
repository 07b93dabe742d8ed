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
from contactsense.calibration.recording_residuals import GAP, residuals
from contactsense.calibration.residual_jacobian import inertial_columns
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.setup_check.tool_terms import tool_terms

BANDWIDTH = 2.0
"""Cut-off frequency of the filter [Hz]: slow motion lies below it, most of the noise above."""
_INTERVAL = 0.25
"""Time between rows [s], three time constants of the filter: white noise is nearly independent between them.
"""
_SETTLING = 12.0
"""Time constants until the filter has forgotten its start: even a bias of a thousand newtons."""
SETTLING_TIME = _SETTLING / (2.0 * np.pi * BANDWIDTH)
"""The same [s]."""
_MOTION_INTERVAL = 0.02
"""The motion is followed at steps of at most this length, and of at least one sample [s]."""
_NODE_INTERVAL = 0.05
"""Time between the nodes about an instant [s]."""
_MAX_ROWS = 400
"""Longer recordings have rows at larger intervals."""


@dataclass(frozen=True)
class MotionBasis:
    """Filtered terms at M instants of one or more recordings, for one arm with n joints and L links.

    Terms of the base sensor are known at three nodes about each instant, so that its delay can be changed:
    the prediction is interpolated rather than the readings, whose noise would change with the delay.
    """

    joint_gravity: np.ndarray
    """Joint torques per gravity component and inertial parameter, shape (3, M, n, L, 10)."""
    joint_dynamics: np.ndarray
    """The same for the motion alone, shape (M, n, L, 10)."""
    base_gravity: np.ndarray
    """Wrench of the arm on the base sensor per gravity component and inertial parameter, base axes, at the
    nodes before, at and after each instant, shape (3, M, 3, 6, L, 10)."""
    base_dynamics: np.ndarray
    """The same for the motion alone, shape (M, 3, 6, L, 10)."""
    wrist_gravity: np.ndarray
    """Wrench of the tool on the wrist sensor per gravity component and inertial parameter of the tool, flange
    axes and origin, shape (3, M, 6, 10)."""
    wrist_dynamics: np.ndarray
    """The same for the motion alone, shape (M, 6, 10)."""
    nodes: np.ndarray
    """Times of the nodes after the instant [s], shape (M, 3)."""
    rotor: np.ndarray
    """Joint accelerations [rad/s^2], shape (M, n)."""
    coulomb: np.ndarray
    """Smooth signs of the joint velocities, shape (M, n)."""
    viscous: np.ndarray
    """Joint velocities [rad/s], shape (M, n)."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Terms of the scene's arm for a motion; the readings are not used."""
        parts = [_terms(scene, part, at) for part, at in zip(recordings, instants(recordings), strict=True)]
        joint_gravity, joint_dynamics, base_gravity, base_dynamics, wrist_gravity, *others = zip(
            *parts, strict=True
        )
        return cls(
            np.concatenate(joint_gravity, axis=1),
            np.concatenate(joint_dynamics),
            np.concatenate(base_gravity, axis=1),
            np.concatenate(base_dynamics),
            np.concatenate(wrist_gravity, axis=1),
            *(np.concatenate(terms) for terms in others),
        )

    def joints(self, gravity: np.ndarray, with_gravity: bool, with_inertia: bool) -> np.ndarray:
        """Torques per inertial parameter, shape (M, n, L, 10), under `gravity` (3,) in base axes [m/s^2]."""
        terms = np.zeros_like(self.joint_dynamics)
        if with_gravity:
            terms += np.tensordot(gravity, self.joint_gravity, 1)
        return terms + self.joint_dynamics if with_inertia else terms

    def wrist(self, gravity: np.ndarray) -> np.ndarray:
        """Wrench of the tool per inertial parameter of the tool, flange axes and origin, shape (M, 6, 10)."""
        return np.asarray(np.tensordot(gravity, self.wrist_gravity, 1) + self.wrist_dynamics)

    def base(self, gravity: np.ndarray, delay: float) -> np.ndarray:
        """Wrench per inertial parameter `delay` [s] before each instant, shape (M, 6, L, 10)."""
        if delay == 0.0:
            return np.asarray(np.tensordot(gravity, self.base_gravity[:, :, 1], 1) + self.base_dynamics[:, 1])
        terms = np.tensordot(gravity, self.base_gravity, 1) + self.base_dynamics
        return np.asarray(np.einsum("mk,mkclp->mclp", _lagrange(self.nodes, -delay), terms))


def _lagrange(nodes: np.ndarray, at: float) -> np.ndarray:
    """Weights of the parabola through the values at three nodes, shape (M, 3), for its value at `at`."""
    a, b, c = nodes.T
    return np.column_stack(
        (
            (at - b) * (at - c) / ((a - b) * (a - c)),
            (at - a) * (at - c) / ((b - a) * (b - c)),
            (at - a) * (at - b) / ((c - a) * (c - b)),
        )
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
    """Filtered readings at the instants of a `MotionBasis`, as they were read under the scene."""

    torque: np.ndarray | None
    """Joint torques, shape (M, n) [Nm]; None unless scene and every recording have them."""
    wrench: np.ndarray | None
    """Of the base sensor, shape (M, 6) [N, Nm]; None unless scene and every recording have them."""
    wrist: np.ndarray | None
    """Of the wrist sensor, shape (M, 6) [N, Nm]; None unless scene and every recording have them."""
    variance_ratio: float
    """Variance of filtered over that of single samples, for white noise."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Filtered readings of all recordings."""
        n = recordings[0].q.shape[1]
        filtered = np.concatenate(
            [
                residuals(_massless(scene), part, BANDWIDTH)[at.samples]
                for part, at in zip(recordings, instants(recordings), strict=True)
            ]
        )
        torque = scene.joint_torque is not None and all(part.torque is not None for part in recordings)
        wrench = scene.base_wrench is not None and all(part.reading is not None for part in recordings)
        wrist = None
        if scene.wrist_wrench is not None and all(part.wrist is not None for part in recordings):
            alone = [replace(part, reading=part.wrist) for part in recordings]
            wrist = np.concatenate(
                [
                    residuals(_massless(scene), part, BANDWIDTH)[at.samples, n:]
                    for part, at in zip(alone, instants(recordings), strict=True)
                ]
            )
        dt = float(np.median(np.concatenate([np.diff(part.t) for part in recordings])))
        return cls(
            -filtered[:, :n] if torque else None,
            filtered[:, n:] if wrench else None,
            wrist,
            noise_variance_ratio(BANDWIDTH, dt),
        )


@dataclass(frozen=True)
class Instants:
    """Which samples of one recording are used."""

    every: int
    """The motion is followed at every so many samples: it is smooth, unlike the readings."""
    keep: slice
    """All nodes, among those samples."""
    nodes: np.ndarray
    """Indices of the nodes of each instant within `keep`, shape (M, 3)."""
    samples: np.ndarray
    """Index of each instant's sample in the recording, shape (M,)."""


def instants(recordings: list[FreeMotion]) -> list[Instants]:
    """The instants of each recording."""
    interval = max(_INTERVAL, sum(part.seconds for part in recordings) / _MAX_ROWS)
    found = []
    for part in recordings:
        dt = float(np.median(np.diff(part.t)))
        every = max(1, int(_MOTION_INTERVAL / dt + 1e-6))
        t = part.t[::every]
        start = int(np.searchsorted(t, t[0] + SETTLING_TIME))
        stride = max(1, round(_NODE_INTERVAL / (every * dt)))
        count = len(range(start, len(t), stride))
        middle = np.arange(1, count - 1, max(1, round(interval / _NODE_INTERVAL)))
        nodes = middle[:, None] + np.array([-1, 0, 1])
        found.append(Instants(every, slice(start, None, stride), nodes, every * (start + stride * middle)))
    return found


def without_gaps(recordings: list[FreeMotion]) -> list[FreeMotion]:
    """The recordings cut where samples are missing for so long that the filter starts anew; parts in which it
    does not settle are left out."""
    found = []
    for whole in recordings:
        cuts = np.flatnonzero(np.diff(whole.t) > GAP) + 1
        for rows in np.split(np.arange(len(whole.t)), cuts):
            if len(rows) > 2 and whole.t[rows[-1]] - whole.t[rows[0]] > SETTLING_TIME:
                part = {
                    name: None if value is None else value[rows]
                    for name in ("t", "q", "qd", "torque", "reading", "wrist")
                    for value in (getattr(whole, name),)
                }
                found.append(FreeMotion(**part, name=whole.name))  # type: ignore[arg-type]
    return found


def _massless(scene: Scene) -> CalibrationModel:
    """An arm without mass and friction with sensors in base axes: its residuals are the filtered readings."""
    plain = scene.model_copy(
        update={"base_wrench": WrenchSensor(), "joint_torque": JointTorqueSensor(), "tool": None}
    )
    arm = CalibrationModel.of(plain)
    return arm.with_values(links=np.zeros_like(arm.links), rotor=np.zeros_like(arm.rotor))


def _terms(scene: Scene, part: FreeMotion, at: Instants) -> tuple[np.ndarray, ...]:
    n = part.q.shape[1]
    arm = _massless(scene)
    middle = at.nodes[:, 1]
    part = FreeMotion(part.t[:: at.every], part.q[:: at.every], part.qd[:: at.every])

    def columns(gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = inertial_columns(arm, part, gravity, BANDWIDTH, at.keep)
        # The observer's residual is model minus measurement for joints, the reverse for the base.
        return found[middle, :n], -found[at.nodes, n:]

    joints, base = columns(np.zeros(3))
    by_axis = [columns(axis) for axis in np.eye(3)]
    still = replace(part, torque=np.zeros_like(part.q))
    ones = np.ones(n)
    friction = (
        residuals(arm.with_values(**{name: ones}), still, BANDWIDTH)[at.keep][middle, :n]
        for name in ("rotor", "coulomb", "viscous")
    )
    wrist = [terms[at.keep][middle] for terms in tool_terms(scene, part, BANDWIDTH)]
    times = part.t[at.keep]
    return (
        np.array([axis[0] - joints for axis in by_axis]),
        joints,
        np.array([axis[1] - base for axis in by_axis]),
        base,
        np.array(wrist[:3]),
        wrist[3],
        times[at.nodes] - times[middle][:, None],
        *friction,
    )
