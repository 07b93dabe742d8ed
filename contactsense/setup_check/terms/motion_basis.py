"""A recording as the terms of equations that are linear in what a scene states.

Rigid-body dynamics is linear in the links' inertial parameters and affine in gravity, and a low-pass filter
commutes with every constant matrix. So a recording is passed through the momentum observer once, and the
prediction of any other mounting, tool or sensor frame is a product of small matrices.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import residuals
from contactsense.kinematics.model import Model
from contactsense.scene import JointTorqueSensor, Scene, WrenchSensor
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.setup_check.lines import recorded_sensors, sensors_in, wrench_fields
from contactsense.setup_check.setup import Order, in_order
from contactsense.setup_check.terms.instants import BANDWIDTH, MIDDLE, Instants, averaged_noise, instants
from contactsense.setup_check.terms.joint_terms import JointTerms
from contactsense.setup_check.terms.load_terms import LoadTerms


class MotionBasis:
    """Terms of a motion at M instants, for one arm with n joints and L links; worked out when needed."""

    def __init__(
        self, model: Model, velocity: float, recordings: list[FreeMotion], places: list[Instants]
    ) -> None:
        """See `contactsense.setup_check.terms.joint_terms.JointTerms.of`."""
        self._model, self._recordings, self._instants = model, recordings, places
        self.joints = JointTerms.of(model, velocity, recordings, places)
        self._loads: dict[int, LoadTerms] = {}

    @property
    def rows(self) -> int:
        """M."""
        return len(self.joints.values)

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return self.joints.values.nbytes + sum(terms.values.nbytes for terms in self._loads.values())

    def loads(self, body: int) -> LoadTerms:
        """Terms of a link and all beyond it; `body`: its index, the base being 0."""
        if body not in self._loads:
            self._loads[body] = LoadTerms.of(self._model, body, self._recordings, self._instants)
        return self._loads[body]

    def reversals(self, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """Smooth signs of the joint velocities at the instants and `_LATE_REVERSAL` before them, shape (M, n)
        each; both earlier by `-delay` where the torques come early, with a negative delay [s].

        Friction reverses later than the velocity, after a small displacement (B. Armstrong-Helouvry, P.
        Dupont, C. Canudas de Wit, "A survey of models, analysis tools and compensation methods for the
        control of machines with friction", Automatica 1994). So the friction of every setup may reverse
        late, and only weight and inertia tell how late the torques are. It never reverses before the
        velocity: where it seems to, the torques come early.
        """
        first = min(delay, 0.0)
        return self.joints.coulomb(first), self.joints.coulomb(first + _LATE_REVERSAL)


_LATE_REVERSAL = 0.1
"""By how much friction may reverse later than the velocity [s]."""
_MEMORY = 100_000_000
"""Bytes for terms where joints have other zeros: fits of many hypotheses begin at the same zeros, and move on
from there."""
_Motion = tuple[str, float, Order, tuple[float, ...]]


class MotionBases:
    """The terms of one motion for several arms, and units, orders and zeros of the joint positions, worked
    out when needed."""

    def __init__(self, scenes: Mapping[str, Scene], recordings: list[FreeMotion]) -> None:
        """`scenes`: by name of the arm."""
        self._recordings, self._instants = recordings, instants(recordings)
        self._models = {name: model_with_tool(scene) for name, scene in scenes.items()}
        self._velocities = {
            name: (scene.joint_torque or JointTorqueSensor()).friction.velocity
            for name, scene in scenes.items()
        }
        self._known: dict[_Motion, MotionBasis] = {}

    def of(self, robot: str, unit: float, order: Order, zero: tuple[float, ...]) -> MotionBasis:
        """Terms for that arm, if joint positions are in `unit` [rad] and in this order, and `zero` [rad] is
        added to them."""
        motion = robot, unit, order, zero
        found = self._known.pop(motion, None)
        if found is None:
            moved = [
                replace(part, q=unit * in_order(part.q, order) + zero, qd=unit * in_order(part.qd, order))
                for part in self._recordings
            ]
            found = MotionBasis(self._models[robot], self._velocities[robot], moved, self._instants)
            self._forget(found.size)
        # The least recently used are the first.
        self._known[motion] = found
        return found

    def _forget(self, size: int) -> None:
        """Make room for so many bytes."""
        shifted = [motion for motion in self._known if any(motion[3])]
        taken = size + sum(self._known[motion].size for motion in shifted)
        for motion in shifted:
            if taken <= _MEMORY:
                break
            taken -= self._known.pop(motion).size


@dataclass(frozen=True)
class Readings:
    """Filtered and averaged readings at the instants of a `MotionBasis`, as read under the scene; NaN in
    recordings that lack the sensor."""

    torque: np.ndarray | None
    """Joint torques, shape (M, n) [Nm]; None unless the scene and any recording have them."""
    wrenches: Mapping[str, np.ndarray]
    """Of each force/torque sensor that the scene and any recording have, by field, shape (M, 6) [N, Nm]."""
    variance_ratio: float
    """Variance of white noise in them over that in single samples."""
    starts: np.ndarray
    """Numbers of the instants at which another recording begins, int."""

    @classmethod
    def of(cls, scene: Scene, recordings: list[FreeMotion]) -> Self:
        """Filtered readings of all recordings."""
        n = recordings[0].q.shape[1]
        arm, places = _massless(scene), instants(recordings)

        def filtered(field: str, channels: slice) -> np.ndarray:
            """Those channels of the joints and one force/torque sensor, which read the sensor `field`."""
            found = []
            for part, at in zip(recordings, places, strict=True):
                alone = replace(part, reading=part.readings.get(field))
                values = at.averages_of(residuals(arm, alone, BANDWIDTH)[:, channels])[:, MIDDLE]
                found.append(values if field in sensors_in(scene, part) else np.full_like(values, np.nan))
            return np.concatenate(found)

        there = recorded_sensors(scene, recordings)
        dt = float(np.median(np.concatenate([np.diff(part.t) for part in recordings])))
        return cls(
            -filtered("joint_torque", slice(n)) if "joint_torque" in there else None,
            {field: filtered(field, slice(n, None)) for field in wrench_fields(scene) if field in there},
            averaged_noise(dt),
            np.unique(np.cumsum([len(at.nodes) for at in places if len(at.nodes)])[:-1]),
        )

    def measured(self, joints: int, fields: Sequence[str]) -> np.ndarray:
        """Whether each channel is measured at each instant, shape (C, M): those of the joints, then six of
        each of the force/torque sensors in `fields`."""
        signals = [(self.torque, joints), *((self.wrenches.get(field), 6) for field in fields)]
        rows = next(len(values) for values, _ in signals if values is not None)
        return np.concatenate(
            [np.isfinite(x).T if x is not None else np.zeros((size, rows), bool) for x, size in signals]
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
