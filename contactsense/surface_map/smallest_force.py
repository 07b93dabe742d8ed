"""Smallest force that is detected, from the noncentral chi-square distribution of the residuals' energy."""

import numpy as np

from contactsense.detection.detectable_force import detected_length
from contactsense.detection.thresholds import SampleThresholds, degrees_of_freedom_of
from contactsense.scene import Scene
from contactsense.surface_map.sensor_response import wrench


def detected_size(scene: Scene, detection: float) -> float:
    """Length of the mean residuals, in units of their noise, that is detected with that probability.

    A measurement is a contact if the energy of the no-contact hypothesis exceeds the threshold of the scene's
    false-alarm rate (`contactsense.detection.detectable_force.detected_length`).

    Args:
        scene: With sensors and false alarms per hour.
        detection: Probability of detection in one measurement.
    """
    link_sensors = (1 << len(scene.link_sensors)) - 1
    usable = (scene.base_wrench is not None, scene.joint_torque is not None, link_sensors)
    degrees = degrees_of_freedom_of(len(scene.robot.joints), usable)
    return detected_length(SampleThresholds(scene).threshold(usable), degrees, detection)


def smallest_force(response: np.ndarray, size: float, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Smallest force along the inward normal that is detected.

    Args:
        response: `sensor_response` of the touched link at each place, shape (N, rows, 6).
        size: `detected_size`.
        point, normal: Places and outward normals, base frame, shape (N, 3) [m].

    Returns:
        Shape (N,) [N]; infinite where no sensor measures the push.
    """
    per_newton = np.linalg.norm(np.einsum("nij,nj->ni", response, wrench(-normal, point)), axis=1)
    with np.errstate(divide="ignore"):
        return np.asarray(size / per_newton)
