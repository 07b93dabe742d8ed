"""Covariance of the place that the localizer finds for a push, and the radius around it that holds a given
share of the answers.

The unknowns of a contact on one link are those of `contactsense.solvers.posterior`: the relative normal
force, the two ratios of tangential to normal force and the torsion ratio, each in units of its prior's
standard deviation, and the step v along the two tangents of the surface [m]. With the Jacobian J of the
residuals, in units of their noise, and the information D of the priors, the localizer's answer is linear in
noise and prior for small errors, with the Gauss-Newton matrix H = J^T J + D. So its covariance is

    H^-1 (J^T J + D V D) H^-1

where V is the covariance of the actual push about the prior's mode. With V = D^-1 it would be H^-1, the
Bayesian Cramer-Rao bound (H. L. Van Trees, "Detection, estimation, and modulation theory I", 1968, section
2.4); but D allows for the tilt of the real surface, and has the factor F^-4 of
`contactsense.solvers.posterior.equations`. A push along the inward normal has V = 0. The surface's offset
along the normal does not change the place of such a push.
"""

import numpy as np

from contactsense.localization.ranking import LINE_OF_ACTION_DEVIATION
from contactsense.solvers.posterior.contact_prior import FORCE_POWER, STUDENT_DOF, Prior
from contactsense.solvers.posterior.gauss_newton import LEAST_WEIGHT
from contactsense.surface_map.places import Places
from contactsense.surface_map.sensor_response import wrench

_NO_INFORMATION = 1e-2
"""Information where nothing determines a step along the surface: a standard deviation of 10 m, more than any
link [1/m^2]."""
_ANGLES = (np.arange(90) + 0.5) * (np.pi / 90)
_HALVINGS = 50
_PASSES = 4
"""The weight of the friction prior depends on the error, which depends on the weight."""
_SMALLEST_VARIANCE = 1e-18
"""Keeps the radius of a point-like distribution finite: a nanometre [m^2]."""


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


def step_jacobian(response: np.ndarray, places: Places, force: float, turning: bool = True) -> np.ndarray:
    """Derivative of the residuals by a step of the place along each tangent, shape (N, rows, 2) [1/m].

    Args:
        response, places, force: As for `push_jacobian`.
        turning: Whether the force turns with the normal of the curved surface.
    """
    columns = []
    for i in range(2):
        moved = np.cross(places.tangents[:, :, i], -force * places.normal)
        column = np.concatenate((np.zeros_like(moved), moved), axis=1)
        if turning:
            column += wrench(-force * places.turn[:, :, i], places.point)
        columns.append(column)
    return np.asarray(np.einsum("nri,kni->nrk", response, np.stack(columns)))


def place_gain(response: np.ndarray, places: Places, prior: Prior, force: float) -> np.ndarray:
    """Change of the localizer's place along the tangents per change of the readings, to first order.

    Args:
        response, places, prior, force: As for `push_jacobian`.

    Returns:
        Shape (N, 2, rows) [m].
    """
    jacobian = _jacobian(response, places, prior, force)
    information = np.einsum("nik,nil->nkl", jacobian, jacobian)
    information += _prior_information(np.zeros(len(jacobian)), places.friction_ratio)
    return np.asarray(np.linalg.solve(information, jacobian.transpose(0, 2, 1))[:, 4:])


def place_covariance(
    response: np.ndarray, places: Places, prior: Prior, force: float, friction: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of the localizer's place about the true one, and the covariance that it states.

    Args:
        response, places, prior, force: As for `push_jacobian`.
        friction: Coefficient of friction of the pushes, or that at each place, shape (N,): their inclinations
            are uniform in the friction cone; 0: along the inward normal, without torsion.

    Returns:
        Two covariances along the tangents, shape (N, 2, 2) each [m^2].
    """
    jacobian = _jacobian(response, places, prior, force)
    measured = np.einsum("nik,nil->nkl", jacobian, jacobian)
    # A uniform distribution on a disc has half its radius as standard deviation along each axis.
    inclination = (0.5 * friction / places.friction_ratio) ** 2
    none = np.zeros_like(inclination)
    torsion = np.where(inclination > 0.0, 1.0, 0.0)
    actual = np.stack((none, inclination, inclination, torsion, none, none), axis=1)[:, :, None] * np.eye(6)
    shape = np.einsum("nai,naj->nij", places.tangents, places.turn) / places.friction_ratio[:, None, None]
    squared_ratio = 2.0 * inclination
    for _ in range(_PASSES):
        of_prior = _prior_information(squared_ratio, places.friction_ratio)
        stated = np.linalg.inv(measured + of_prior)
        # A step along a curved surface inclines the force that was measured.
        inclined = np.einsum("nij,njk,nik->n", shape, stated[:, 4:, 4:], shape)
        squared_ratio = 2.0 * inclination + inclined
    found = stated @ (measured + of_prior @ actual @ of_prior) @ stated
    return found[:, 4:, 4:], stated[:, 4:, 4:]


def line_of_action_known(response: np.ndarray, origin: np.ndarray, force: float) -> np.ndarray:
    """Whether the localizer takes the line of action of a push on each link for known, shape (links,), bool.

    It then answers with a mode (`contactsense.localization.ranking`).

    Args:
        response: `sensor_response`, shape (links, rows, 6).
        origin: Origins of the links, base frame, shape (links, 3) [m].
        force: Normal force [N].
    """
    known = np.linalg.matrix_rank(response) == 6
    for link in np.flatnonzero(known):
        about_origin = np.concatenate((np.cross(np.eye(3), origin[link]).T, np.eye(3)), axis=1)
        covariance = about_origin @ np.linalg.inv(response[link].T @ response[link]) @ about_origin.T
        known[link] = np.trace(covariance) < (LINE_OF_ACTION_DEVIATION * force) ** 2
    return np.asarray(known)


def _jacobian(response: np.ndarray, places: Places, prior: Prior, force: float) -> np.ndarray:
    """Derivative of the residuals by all six unknowns, shape (N, rows, 6)."""
    columns = push_jacobian(response, places, prior, force), step_jacobian(response, places, force)
    return np.concatenate(columns, axis=2)


def _prior_information(squared_ratio: np.ndarray, friction_ratio: np.ndarray) -> np.ndarray:
    """Information D of the priors, shape (N, 6, 6), for the mean squared friction ratio and the prior's own
    ratio at each place, shapes (N,).

    The terms of the friction ratio have the weight of their gradient at that ratio, as in
    `contactsense.solvers.posterior.equations`.
    """
    squared_friction = friction_ratio**2
    weight = (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio)
    weight = np.maximum(
        weight - FORCE_POWER * squared_friction / (1.0 + squared_friction * squared_ratio), LEAST_WEIGHT
    )
    one, unknown = np.ones_like(weight), np.full_like(weight, _NO_INFORMATION)
    diagonal = np.stack((one, weight, weight, one, unknown, unknown), axis=1)
    return np.asarray(diagonal[:, :, None] * np.eye(6))


def radius_of_share(covariance: np.ndarray, share: float) -> np.ndarray:
    """Radius of the circle around the mean that holds a given share of a bivariate normal distribution.

    A point is (a cos t, b sin t) times a Rayleigh variable, with the standard deviations a and b, and t
    uniform on the circle. So the share within r is the mean over t of 1 - exp(-r^2 / (2 s^2)), with s^2 =
    a^2 cos^2 t + b^2 sin^2 t.

    Args:
        covariance: Shape (N, 2, 2) [m^2].
        share: Between 0 and 1.

    Returns:
        Shape (N,) [m].
    """
    variances = np.maximum(np.linalg.eigvalsh(covariance), _SMALLEST_VARIANCE)
    along = variances[:, :1] * np.cos(_ANGLES) ** 2 + variances[:, 1:] * np.sin(_ANGLES) ** 2
    low, high = np.zeros(len(variances)), 10.0 * np.sqrt(variances.sum(axis=1))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        inside = -np.expm1(-0.5 * middle[:, None] ** 2 / along).mean(axis=1)
        low, high = np.where(inside < share, middle, low), np.where(inside < share, high, middle)
    return np.asarray(0.5 * (low + high))
