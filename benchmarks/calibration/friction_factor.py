"""Residuals of moving joints in real streams: with friction as calibrated, and with its factor estimated; and
as large as they are stated to be."""

from typing import NamedTuple

import numpy as np

from contactsense import Localizer, SampleBlock, Scene
from contactsense.calibration import FreeMotion
from contactsense.calibration.residuals.recording_residuals import settled_samples

MOVING = 0.05
"""A joint moves if it is faster than this [rad/s]; slower ones are governed by friction at rest."""


class MovingResiduals(NamedTuple):
    """RMS residual of each joint while it moves, shape (n,) [Nm]; NaN for a joint that does not."""

    calibrated: np.ndarray
    """With friction as in the scene."""
    estimated: np.ndarray
    """With its factor estimated in the stream."""
    stated: np.ndarray
    """RMS of their stated standard deviation, with the factor estimated, shape (n,) [Nm]."""
    factor: np.ndarray
    """That factor at the end of the stream, shape (n,)."""


def moving_residuals(scene: Scene, recording: FreeMotion) -> MovingResiduals:
    """Process a recording of contact-free motion as a stream, with and without the factor.

    Args:
        scene: With joint torques and a stated `Friction.error`.
        recording: With torques.
    """
    torque = scene.joint_torque
    assert torque is not None
    kept = torque.model_copy(update={"friction": torque.friction.model_copy(update={"error": 0.0})})
    calibrated, _, _ = _rms(scene.model_copy(update={"joint_torque": kept}), recording)
    return MovingResiduals(calibrated, *_rms(scene, recording))


def _rms(scene: Scene, recording: FreeMotion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """RMS of the residuals of moving joints and of their standard deviations, and the factors at the end."""
    localizer = Localizer(scene)
    block = SampleBlock(recording.t, recording.q, recording.qd, recording.torque)
    parts = list(localizer.run_blocks([block]))
    residual = np.concatenate([part.joint_torque for part in parts])
    std = np.concatenate([part.joint_torque_std for part in parts])
    moving = np.abs(recording.qd) > MOVING
    moving[: settled_samples(recording, scene.bandwidth)] = False
    count = moving.sum(axis=0)

    def rms(values: np.ndarray) -> np.ndarray:
        square = np.where(moving, values, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(axis=0) / np.where(count > 0, count, np.nan)))

    return rms(residual), rms(std), localizer.friction_factors
