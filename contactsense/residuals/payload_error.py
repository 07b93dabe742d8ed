"""Errors of a payload that was picked up, in the filter of `contactsense.residuals.bias_filter`.

Mass and horizontal place of a payload follow from the mean wrench of its weight, with the errors of that mean
and of all that the filter estimates. Its height does not: at rest the weight pulls anywhere along its line.
It is found when the last link tilts or turns fast. Payload and last link are one body with one mass and one
centre of mass.
"""

import numpy as np

from contactsense.residuals.bias_filter import (
    BASE_BIASES,
    BiasFilter,
    masses,
    payload_place,
    regressor_of,
)
from contactsense.robots import Inertia

HEIGHT_STD = 0.15
"""Standard deviation of the height of a payload above or below the flange, an assumption [m]."""


def add_payload_errors(
    bias_filter: BiasFilter,
    bare: Inertia,
    payload: Inertia,
    rotation: np.ndarray,
    origin: np.ndarray,
    gravity: np.ndarray,
    noise: np.ndarray,
) -> None:
    """Let the filter estimate the last link together with a payload.

    Args:
        bias_filter: Changed in place.
        bare, payload: The last link without it, and the payload, a point mass.
        rotation, origin: Of the last link's frame in the base frame, shapes (3, 3) and (3,) [m].
        gravity: In base axes, shape (3,) [m/s^2].
        noise: Covariance of the noise of the mean base wrench that the payload follows from, base axes, base
            origin, shape (6, 6).
    """
    n = len(bias_filter.torque_variance)
    P, last, place = bias_filter.covariance, masses(n) + n - 1, payload_place(n)
    estimates = np.append(last, place + np.arange(3))
    mass, down = bare.mass + payload.mass, gravity / np.linalg.norm(gravity)
    com = (bare.mass * bare.com + payload.mass * payload.com) / mass
    # The relative mass of link and payload together, and the payload's place in the link's frame, by what a
    # wrench is more than their weight.
    of_wrench, force = np.zeros((4, 6)), mass * gravity
    of_wrench[0, :3] = down / np.linalg.norm(force)
    moment = np.eye(6)[3:] - np.outer(np.cross(origin + rotation @ com, force), of_wrench[0])
    of_wrench[1:] = rotation.T @ np.cross(down, moment, axisb=0).T / np.linalg.norm(payload.mass * gravity)
    # The error of the link's own mass, as one of both; then what the wrench tells wrongly.
    transfer = np.eye(len(P))
    transfer[estimates] = of_wrench @ _rows_of_base_wrench(bias_filter)
    transfer[estimates, last] += np.append(bare.mass / mass, bare.mass * (bare.com - com) / payload.mass)
    bias_filter.bare_covariance[:] = transfer @ P[last]
    P[:] = transfer @ P @ transfer.T
    P[np.ix_(estimates, estimates)] += of_wrench @ noise @ of_wrench.T
    bias_filter.height_axis[:] = rotation.T @ down
    height = HEIGHT_STD * rotation.T @ down
    P[place : place + 3, place : place + 3] += np.outer(height, height)
    bias_filter.payload_place[:], bias_filter.gravity[:] = payload.com, gravity
    status = bias_filter.status[0]
    status.payload_mass, status.estimates_masses = payload.mass, True
    _restart_regressor(bias_filter)


def remove_payload_errors(bias_filter: BiasFilter, mass_variance: float, estimates_masses: bool) -> None:
    """Let the filter estimate the last link alone again, as it was before `add_payload_errors`.

    What it has learnt of the link's mass meanwhile is that of link and payload, mostly the latter's. But its
    error is still related to those of biases and other masses, of which the sensors tell only sums: taken for
    independent, all of them would seem to be known soon.

    Args:
        bias_filter: Changed in place.
        mass_variance: Variance of the link's mass before, relative.
        estimates_masses: Whether masses are estimated without payload.
    """
    n = len(bias_filter.torque_variance)
    last, P = masses(n) + n - 1, bias_filter.covariance
    P[last:, :] = P[:, last:] = 0.0
    P[last, :last] = P[:last, last] = bias_filter.bare_covariance[:last]
    P[last, last] = mass_variance
    status = bias_filter.status[0]
    status.payload_mass, status.estimates_masses = 0.0, estimates_masses
    _restart_regressor(bias_filter)


def _rows_of_base_wrench(bias_filter: BiasFilter) -> np.ndarray:
    """By how much each error makes the measured base wrench too small: rows of Phi, shape (6, estimates)."""
    n = len(bias_filter.torque_variance)
    rows = np.zeros((6, len(bias_filter.covariance)))
    rows[:, BASE_BIASES : BASE_BIASES + 6] = -np.eye(6)
    for k in range(n):
        at = regressor_of(n, k) + n
        rows[:, masses(n) + k] = bias_filter.mass_regressor.residual[at : at + 6]
    return rows


def _restart_regressor(bias_filter: BiasFilter) -> None:
    for array in (*bias_filter.mass_regressor, *bias_filter.height_regressor):
        np.asarray(array).fill(0)
