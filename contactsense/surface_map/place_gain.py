"""Change of the localizer's place per change of the readings, to first order.

The unknowns of a contact on one link are those of `contactsense.solvers.posterior`: the relative normal
force, the two ratios of tangential to normal force and the torsion ratio, each in units of its prior's
standard deviation, and the step v along the two tangents of the surface [m]. With the Jacobian J of the
residuals, in units of their noise, and the information D of the priors, the localizer's answer to small
residuals r is (J^T J + D)^-1 J^T r.
"""

import numpy as np

from contactsense.solvers.posterior.contact_prior import FORCE_POWER, STUDENT_DOF, Prior
from contactsense.surface_map.places import Places
from contactsense.surface_map.sensor_response import wrench

_NO_INFORMATION = 1e-2
"""Information where nothing determines a step along the surface: a standard deviation of 10 m, more than any
link [1/m^2]."""


def push_jacobian(response: np.ndarray, places: Places, prior: Prior, force: float) -> np.ndarray:
    """Derivative of the residuals by force, friction ratios and torsion ratio, each in units of its prior.

    Args:
        response: `sensor_response` of each place's link, shape (N, rows, 6).
        places: The N places.
        prior: Of contacts.
        force: Normal force [N]; the logarithm of the force has a prior of standard deviation 1.

    Returns:
        Shape (N, rows, 4).
    """
    point, inclined = places.point, force * places.friction_ratio[:, None, None] * places.tangents
    columns = (
        wrench(-force * places.normal, point),
        wrench(inclined[:, :, 0], point),
        wrench(inclined[:, :, 1], point),
        np.concatenate((np.zeros_like(point), force * prior.torsion_lever * places.normal), axis=1),
    )
    return np.asarray(np.einsum("nri,kni->nrk", response, np.stack(columns)))


def step_jacobian(response: np.ndarray, places: Places, force: float) -> np.ndarray:
    """Derivative of the residuals by a step of the place along each tangent; the force turns with the
    normal. Shape (N, rows, 2) [1/m].

    Args:
        response, places, force: As for `push_jacobian`.
    """
    columns = []
    for i in range(2):
        moved = np.cross(places.tangents[:, :, i], -force * places.normal)
        turned = wrench(-force * places.turn[:, :, i], places.point)
        columns.append(turned + np.concatenate((np.zeros_like(moved), moved), axis=1))
    return np.asarray(np.einsum("nri,kni->nrk", response, np.stack(columns)))


def place_gain(response: np.ndarray, places: Places, prior: Prior, force: float) -> np.ndarray:
    """Change of the localizer's place along the tangents per change of the residuals, to first order.

    Args:
        response, places, prior, force: As for `push_jacobian`.

    Returns:
        Shape (N, 2, rows) [m].
    """
    parts = push_jacobian(response, places, prior, force), step_jacobian(response, places, force)
    jacobian = np.concatenate(parts, axis=2)
    information = np.einsum("nik,nil->nkl", jacobian, jacobian) + _prior_information(places.friction_ratio)
    return np.asarray(np.linalg.solve(information, jacobian.transpose(0, 2, 1))[:, 4:])


def _prior_information(friction_ratio: np.ndarray) -> np.ndarray:
    """Information D of the priors for a push along the normal, shape (N, 6, 6).

    The terms of the friction ratio have the weight of their gradient there, as in
    `contactsense.solvers.posterior.equations`.

    Args:
        friction_ratio: Of the prior at each place, shape (N,).
    """
    weight = (STUDENT_DOF + 2.0) / STUDENT_DOF - FORCE_POWER * friction_ratio**2
    one, unknown = np.ones_like(weight), np.full_like(weight, _NO_INFORMATION)
    diagonal = np.stack((one, weight, weight, one, unknown, unknown), axis=1)
    return np.asarray(diagonal[:, :, None] * np.eye(6))
