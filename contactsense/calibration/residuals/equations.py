"""All equations of a calibration: joints, base sensor, and the sensors within the arm, in this order."""

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import Entry
from contactsense.calibration.residuals.link_residuals import link_residuals, link_rows
from contactsense.calibration.residuals.recording_residuals import residuals
from contactsense.calibration.residuals.residual_jacobian import Rows, linearize
from contactsense.scene import Scene


def channels(scene: Scene) -> int:
    """Number of equations: one per joint, and six for the base and for each sensor within the arm."""
    return len(scene.robot.joints) + 6 * (1 + len(scene.link_sensors))


def measured_channels(scene: Scene, recordings: list[FreeMotion]) -> np.ndarray:
    """Which of the C equations any of the recordings has a sensor for, shape (C,), bool."""
    torque = any(recording.torque is not None for recording in recordings)
    found = [torque] * len(scene.robot.joints)
    for field in ("base_wrench", *scene.link_sensors):
        found += [any(field in recording.readings for recording in recordings)] * 6
    return np.array(found)


def all_residuals(arm: CalibrationModel, recording: FreeMotion, bandwidth: float) -> np.ndarray:
    """Residuals of all C equations, shape (N, C) [Nm, then N and Nm]; zeros for a missing sensor.

    Args:
        arm: Parameters of arm and sensors.
        recording: Contact-free motion.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    parts = [residuals(arm, recording, bandwidth)]
    for field in arm.scene.link_sensors:
        there = field in recording.link_readings
        parts.append(
            link_residuals(arm, recording, field, bandwidth) if there else np.zeros((len(recording.t), 6))
        )
    return np.hstack(parts)


def linearize_all(
    arm: CalibrationModel, recording: FreeMotion, selected: tuple[Entry, ...], bandwidth: float
) -> list[Rows]:
    """Residuals and derivatives of all equations; arguments as for
    `contactsense.calibration.residuals.residual_jacobian.linearize`."""
    rows = linearize(arm, recording, selected, bandwidth)
    return rows + link_rows(arm, recording, selected, bandwidth)
