"""Residuals of whole recordings, by the observer itself: what calibration makes small."""

import numpy as np

from contactsense.calibration.plant import Plant
from contactsense.calibration.stretch import Stretch
from contactsense.drive import Drive, friction_torque
from contactsense.equations import observe_joints, observe_wrench
from contactsense.observer import Observer, empty_observer
from kinematics.core import dot6, move
from kinematics.model import Model, Motion, empty_motion
from robots.arrays import copy
from robots.compiled import kernel

GAP = 0.05
"""After a longer pause between two samples the observer starts anew [s]."""


@kernel
def _observe(
    model: Model,
    drive: Drive,
    motion: Motion,
    gravity: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    wrench: np.ndarray,
    bandwidth: float,
    gap: float,
    joints: Observer,
    base: Observer,
    spread: np.ndarray,
    of_joints: np.ndarray,
    of_base: np.ndarray,
) -> None:
    for i in range(t.shape[0]):
        dt = 0.0 if i == 0 else t[i] - t[i - 1]
        if dt > gap:
            dt = 0.0
        move(model, q[i], qd[i], gravity, motion)
        if torque.shape[0] > 0:
            observe_joints(model, drive, motion, qd[i], torque[i], dt, bandwidth, joints, spread)
            copy(joints.residual, of_joints[i])
        if wrench.shape[0] > 0:
            observe_wrench(motion.momentum[0], motion.gravity[0], wrench[i], dt, bandwidth, base)
            copy(base.residual, of_base[i])


def residuals(plant: Plant, stretch: Stretch, bandwidth: float) -> np.ndarray:
    """Residuals of joints and base, as a `Localizer` of that scene would have them.

    Args:
        plant: What is assumed of arm and sensors.
        stretch: Contact-free motion.
        bandwidth: Cut-off frequency of the observer [Hz].

    Returns:
        Shape (N, n + 6): n joints [Nm], then the wrench on the base [N, Nm]; zeros for a sensor that the
        stretch does not have.
    """
    n = stretch.q.shape[1]
    none = np.empty((0, 1))
    torque = none if stretch.torque is None else stretch.torque * plant.gain
    wrench = none if stretch.reading is None else plant.base_wrench(stretch.t, stretch.reading)
    of_joints, of_base = np.zeros((len(stretch.t), n)), np.zeros((len(stretch.t), 6))
    _observe(
        plant.model, plant.drive, empty_motion(n), plant.gravity, stretch.t, stretch.q, stretch.qd, torque,
        wrench, bandwidth, GAP, empty_observer(n), empty_observer(6), np.zeros(n), of_joints, of_base,
    )  # fmt: skip
    return np.hstack((of_joints, of_base))


@kernel
def _rub(
    model: Model,
    drive: Drive,
    motion: Motion,
    gravity: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    out: np.ndarray,
) -> None:
    for i in range(q.shape[0]):
        move(model, q[i], qd[i], gravity, motion)
        for j in range(q.shape[1]):
            out[i, j] = friction_torque(drive, j, qd[i, j], dot6(motion.screw[j], motion.gravity[j + 1]))


def friction(plant: Plant, stretch: Stretch) -> np.ndarray:
    """What the plant's formula says of friction at every sample, shape (N, n) [Nm]."""
    out = np.empty_like(stretch.q)
    n = stretch.q.shape[1]
    _rub(plant.model, plant.drive, empty_motion(n), plant.gravity, stretch.q, stretch.qd, out)
    return out
