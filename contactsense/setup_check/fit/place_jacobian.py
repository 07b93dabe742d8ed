"""Derivatives of the moments that a force/torque sensor reads by its place."""

import numpy as np

from contactsense.setup_check.setup import SensorSetup


def place_jacobian(sensor: SensorSetup, reading: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Derivatives of a sensor's prediction by its displacement, from the measured force.

    Those of the prediction itself would follow from the force by the model. It has the noise of the
    velocities, as the moments have: a fit would move the sensor to where that noise is smaller, by decimetres
    where the motion is slow. The noise of the measured force is not in the moments, so neither biases the
    place: the measured force is an instrumental variable, as in
    `contactsense.calibration.residuals.residual_jacobian`. On average it is taken to be the force by the
    model, since a bias is no force.

    Args:
        sensor: What is assumed about the sensor.
        reading: What it reads, shape (M, 6) [N, Nm].
        error: Reading minus prediction, shape (M, 6).

    Returns:
        Shape (M, 6, 3), as read [N/m, Nm/m], along the axes in which the scene gives the place.
    """
    own = np.linalg.inv(sensor.order).T
    force = (reading - sensor.bias - error.mean(axis=0)) @ own
    found = np.zeros((len(reading), 6, 3))
    for i, axis in enumerate(sensor.rotation):
        found[:, 3:, i] = np.cross(force[:, :3], axis)
    return np.asarray(sensor.order @ found)
