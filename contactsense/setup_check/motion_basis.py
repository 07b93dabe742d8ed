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
from contactsense.calibration.residual_jacobian import inertial_columns
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.robots import Robot
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.setup_check.instants import BANDWIDTH, Instants, at_delay, instants
from contactsense.setup_check.lines import wrench_fields
from contactsense.setup_check.load_terms import LoadTerms, load_terms
from contactsense.setup_check.setup import Order, in_order


class Loads:
    """Terms of what the force/torque sensors carry, for one arm; worked out when needed."""

    def __init__(self, robot: Robot, recordings: list[FreeMotion], base: LoadTerms) -> None:
        """`recordings`: without gaps; `base`: the terms of the whole arm on its base."""
        self._robot, self._recordings = robot, recordings
        self._known = {0: base}

    def of(self, body: int) -> LoadTerms:
        """Terms of a link and all beyond it; `body`: its index, the base being 0."""
        if body not in self._known:
            pairs = zip(self._recordings, instants(self._recordings), strict=True)
            parts = [load_terms(self._robot, part, at, body, BANDWIDTH) for part, at in pairs]
            self._known[body] = LoadTerms.joined(parts)
        return self._known[body]


@dataclass(frozen=True)
class MotionBasis:
    """Filtered terms at M instants of one or more recordings, for one arm with n joints and L links."""

    joint_gravity: np.ndarray
    """Joint torques per gravity component and inertial parameter, at the five nodes about each instant, shape
    (3, M, 5, n, L, 10)."""
    joint_dynamics: np.ndarray
    """The same for the motion alone, shape (M, 5, n, L, 10)."""
    rotor: np.ndarray
    """Joint accelerations at the nodes [rad/s^2], shape (M, 5, n)."""
    coulomb: np.ndarray
    """Smooth signs of the joint velocities, shape (M, 5, n)."""
    viscous: np.ndarray
    """Joint velocities [rad/s], shape (M, 5, n)."""
    loads: Loads
    """Terms of the force/torque sensors."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Terms of the scene's arm for a motion; the readings are not used."""
        parts = [_terms(scene, part, at) for part, at in zip(recordings, instants(recordings), strict=True)]
        joint_gravity, joint_dynamics, base, rotor, coulomb, viscous = zip(*parts, strict=True)
        return cls(
            np.concatenate(joint_gravity, axis=1),
            np.concatenate(joint_dynamics),
            np.concatenate(rotor),
            np.concatenate(coulomb),
            np.concatenate(viscous),
            Loads(scene.robot, recordings, LoadTerms.joined(list(base))),
        )

    @property
    def nodes(self) -> np.ndarray:
        """Times of the nodes after the instants [s], shape (M, 5)."""
        return self.loads.of(0).nodes

    def joints(self, gravity: np.ndarray, with_gravity: bool, with_inertia: bool, delay: float) -> np.ndarray:
        """Torques per inertial parameter, shape (M, n, L, 10), `delay` [s] before each instant, under
        `gravity` (3,) in base axes [m/s^2]."""
        dynamics = at_delay(self.joint_dynamics, self.nodes, delay)
        terms = np.zeros_like(dynamics)
        if with_gravity:
            terms += np.tensordot(
                gravity, [at_delay(axis, self.nodes, delay) for axis in self.joint_gravity], 1
            )
        return terms + dynamics if with_inertia else terms

    def reversals(self) -> tuple[np.ndarray, np.ndarray]:
        """`coulomb` at the instants and `_LATE_REVERSAL` before them, shape (M, n) each.

        Friction reverses later than the velocity, after a small displacement (B. Armstrong-Helouvry, P.
        Dupont, C. Canudas de Wit, "A survey of models, analysis tools and compensation methods for the
        control of machines with friction", Automatica 1994). So the friction of every setup may reverse
        late, and only weight and inertia tell the delay of the torques.
        """
        late = at_delay(self.coulomb, self.nodes, _LATE_REVERSAL)
        return at_delay(self.coulomb, self.nodes, 0.0), late


_LATE_REVERSAL = 0.1
"""By how much friction may reverse later than the velocity [s]."""
_LATEST = 4
"""Terms that are kept where joints have other zeros: a fit returns to the latest, and then moves on."""
_Motion = tuple[str, float, Order, tuple[float, ...]]


class MotionBases:
    """The terms of one motion for several arms, and units, orders and zeros of the joint positions, worked
    out when needed."""

    def __init__(self, scenes: Mapping[str, Scene], recordings: list[FreeMotion]) -> None:
        """`scenes`: by name of the arm."""
        self._scenes, self._recordings = scenes, recordings
        self._known: dict[_Motion, MotionBasis] = {}

    def of(self, robot: str, unit: float, order: Order, zero: tuple[float, ...]) -> MotionBasis:
        """Terms for that arm, if joint positions are in `unit` [rad] and in this order, and `zero` [rad] is
        added to them."""
        motion = robot, unit, order, zero
        if motion not in self._known:
            moved = [
                replace(part, q=unit * in_order(part.q, order) + zero, qd=unit * in_order(part.qd, order))
                for part in self._recordings
            ]
            self._known[motion] = MotionBasis.of(self._scenes[robot], moved)
            for old in [known for known in self._known if any(known[3])][:-_LATEST]:
                del self._known[old]
        return self._known[motion]


@dataclass(frozen=True)
class Readings:
    """Filtered readings at the instants of a `MotionBasis`, as they were read under the scene."""

    torque: np.ndarray | None
    """Joint torques, shape (M, n) [Nm]; None unless scene and every recording have them."""
    wrenches: Mapping[str, np.ndarray]
    """Of each force/torque sensor that scene and every recording have, by field, shape (M, 6) [N, Nm]."""
    variance_ratio: float
    """Variance of filtered over that of single samples, for white noise."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Filtered readings of all recordings."""
        n = recordings[0].q.shape[1]
        arm, places = _massless(scene), instants(recordings)

        def filtered(field: str) -> np.ndarray:
            """Of the joints, and of one force/torque sensor."""
            alone = [replace(part, reading=part.readings.get(field)) for part in recordings]
            pairs = zip(alone, places, strict=True)
            return np.concatenate([residuals(arm, part, BANDWIDTH)[at.samples] for part, at in pairs])

        torque = scene.joint_torque is not None and all(part.torque is not None for part in recordings)
        dt = float(np.median(np.concatenate([np.diff(part.t) for part in recordings])))
        return cls(
            -filtered("base_wrench")[:, :n] if torque else None,
            {
                field: filtered(field)[:, n:]
                for field in wrench_fields(scene)
                if all(field in part.readings for part in recordings)
            },
            noise_variance_ratio(BANDWIDTH, dt),
        )


def _massless(scene: Scene) -> CalibrationModel:
    """An arm without mass and friction with sensors in base axes: its residuals are the filtered readings."""
    plain = scene.model_copy(
        update={
            "base_wrench": WrenchSensor(),
            "joint_torque": JointTorqueSensor(),
            "tool": None,
            "wrist_wrench": None,
            "link_wrenches": (),
        }
    )
    arm = CalibrationModel.of(plain)
    return arm.with_values(links=np.zeros_like(arm.links), rotor=np.zeros_like(arm.rotor))


def _terms(
    scene: Scene, part: FreeMotion, at: Instants
) -> tuple[np.ndarray, np.ndarray, LoadTerms, np.ndarray, np.ndarray, np.ndarray]:
    """Terms of the joints, of the base sensor, and of rotors and friction."""
    n = part.q.shape[1]
    arm, times = _massless(scene), at.node_times(part.t)
    part = FreeMotion(part.t[at.motion], part.q[at.motion], part.qd[at.motion])

    def columns(gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = inertial_columns(arm, part, gravity, BANDWIDTH, at.keep)
        # The observer's residual is model minus measurement for joints, the reverse for the base.
        return found[at.nodes, :n], -found[at.nodes, n:]

    joints, base = columns(np.zeros(3))
    by_axis = [columns(axis) for axis in np.eye(3)]
    still = replace(part, torque=np.zeros_like(part.q))
    ones = np.ones(n)
    rotor, coulomb, viscous = (
        residuals(arm.with_values(**{name: ones}), still, BANDWIDTH)[at.keep][at.nodes, :n]
        for name in ("rotor", "coulomb", "viscous")
    )
    loads = LoadTerms(np.array([axis[1] - base for axis in by_axis]), base, times)
    return np.array([axis[0] - joints for axis in by_axis]), joints, loads, rotor, coulomb, viscous
