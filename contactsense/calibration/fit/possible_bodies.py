"""Inertia of links that bodies can have.

A motion determines only sums over links, so that the best estimate of one link may be that of no body. Ten
inertial parameters are those of a body if its pseudo-inertia

    P = [ S  h ]     m: mass,  h: mass times centre of mass,
        [ h' m ],    S = tr(I) / 2 - I with the inertia tensor I about the same origin,

the second moments of its density, is positive definite (P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear
matrix inequalities for physically consistent inertial parameter identification", IEEE Robotics and Automation
Letters 2018). This includes the triangle inequality of the principal moments (S. Traversaro, S. Brossette, A.
Escande, F. Nori, "Identification of fully physical consistent inertial parameters using optimization on
manifolds", IROS 2016).

The linearized equations with their prior are a quadratic form about the best estimate. It is minimized with
a logarithmic barrier that keeps every P positive definite.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.gauss_newton import FittedModel
from contactsense.calibration.parameters import NOT_NEGATIVE, Entry, apply_step, inertial_scales, value

_FLATNESS = 1e-4
"""Smallest eigenvalue of a pseudo-inertia in units of the link's mass and radius of gyration: that of a body
whose thickness is about a hundredth of its size."""
_FIRST = 1e-2
"""The same where the search begins."""
_WEIGHTS = 10.0 ** np.arange(-1, 5)
"""Weights of half the quadratic form against the barrier. The last one misses the minimum by at most 4e-4 per
link."""
_NEWTON_STEPS = 50
_CONVERGED = 1e-6
"""Newton's method ends where the cost would fall by less than half of this."""


@dataclass(frozen=True)
class PossibleBodies:
    """An estimate in which every link is a body."""

    arm: CalibrationModel
    changed: tuple[int, ...]
    """Indices of the links that were none; empty: the estimate is as it was."""


def possible_bodies(
    fitted: FittedModel, selected: tuple[Entry, ...], start: CalibrationModel
) -> PossibleBodies:
    """The best estimate in which every link is a body.

    All other parameters that were estimated follow the links' inertia.

    Args:
        fitted: The estimate without this condition.
        selected: Its parameters.
        start: The scene's values, for the scale of each link.
    """
    arm = fitted.arm
    of_links = np.array([entry.group == "links" for entry in selected])
    numbers = sorted({entry.index[0] for entry in selected if entry.group == "links"})
    scales = _scales(start.links[numbers])
    smallest = np.linalg.eigvalsh(_scaled(arm.links[numbers], scales))[:, 0]
    changed = tuple(k for k, least in zip(numbers, smallest, strict=True) if least < _FLATNESS)
    if not changed:
        return PossibleBodies(arm, ())
    others = fitted.free & ~of_links
    A = fitted.precision
    follow = -np.linalg.solve(A[np.ix_(others, others)], A[np.ix_(others, of_links)])
    marginal = A[np.ix_(of_links, of_links)] + A[np.ix_(of_links, others)] @ follow
    step = np.zeros(len(selected))
    step[of_links] = (_nearest(arm.links[numbers], marginal, scales) - arm.links[numbers]).ravel()
    step[others] = follow @ step[of_links]
    for i, entry in enumerate(selected):
        if entry.group in NOT_NEGATIVE:
            step[i] = max(step[i], -value(arm, entry))
    return PossibleBodies(apply_step(arm, selected, step), changed)


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Pseudo-inertias, shape (K, 4, 4), of bodies with inertial parameters of shape (K, 10)."""
    xx, xy, yy, xz, yz, zz = parameters[:, 4:].T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    found = np.empty((len(parameters), 4, 4))
    found[:, :3, :3] = 0.5 * np.trace(tensor, axis1=1, axis2=2)[:, None, None] * np.eye(3) - tensor
    found[:, :3, 3] = found[:, 3, :3] = parameters[:, 1:4]
    found[:, 3, 3] = parameters[:, 0]
    return found


def inertial_parameters(P: np.ndarray) -> np.ndarray:
    """Inertial parameters, shape (..., 10), of pseudo-inertias of shape (..., 4, 4)."""
    S = P[..., :3, :3]
    tensor = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    columns, rows = np.tril_indices(3)
    return np.concatenate((P[..., 3, 3:], P[..., :3, 3], tensor[..., rows, columns]), axis=-1)


def _scales(links: np.ndarray) -> np.ndarray:
    """Diagonals of D, shape (K, 4): a link of its own mass and radius of gyration has a P of about D D."""
    scales = np.maximum(inertial_scales(links), 1e-9)
    mass, size = scales[:, 0], scales[:, 1] / scales[:, 0]
    return np.asarray(np.sqrt(mass)[:, None] * np.column_stack((size, size, size, np.ones(len(size)))))


def _scaled(links: np.ndarray, scales: np.ndarray) -> np.ndarray:
    return np.asarray(pseudo_inertia(links) / (scales[:, :, None] * scales[:, None, :]))


def _nearest(links: np.ndarray, precision: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """The bodies of shape (K, 10) with the least (x - x0)' precision (x - x0), x0 being `links`.

    By Newton's method with a logarithmic barrier (S. Boyd, L. Vandenberghe, "Convex optimization", 2004,
    chapter 11).
    """
    count = len(links)
    unit = pseudo_inertia(np.eye(10)) / (scales[:, None, :, None] * scales[:, None, None, :])

    def room(x: np.ndarray) -> np.ndarray:
        """By how much each body is one, as positive definite matrices, shape (K, 4, 4)."""
        return np.asarray(np.einsum("ki,kiab->kab", x, unit) - _FLATNESS * np.eye(4))

    def cost(x: np.ndarray, weight: float) -> float:
        change = (x - links).ravel()
        smallest = np.linalg.eigvalsh(room(x))
        if smallest.min() <= 0.0:
            return np.inf
        return float(0.5 * weight * change @ precision @ change - np.log(smallest).sum())

    values, vectors = np.linalg.eigh(_scaled(links, scales))
    first = vectors @ (np.maximum(values, _FIRST)[:, :, None] * vectors.swapaxes(1, 2))
    x = inertial_parameters(first * scales[:, :, None] * scales[:, None, :])
    for weight in _WEIGHTS:
        for _ in range(_NEWTON_STEPS):
            ratio = np.linalg.inv(room(x))[:, None] @ unit
            slope: np.ndarray = (
                weight * precision @ (x - links).ravel() - np.trace(ratio, axis1=2, axis2=3).ravel()
            )
            curvature = block_diag(*np.einsum("kiab,kjba->kij", ratio, ratio))
            step = -np.linalg.solve(weight * precision + curvature, slope)
            before, size = cost(x, weight), 1.0
            while cost(x + size * step.reshape(count, 10), weight) > before and size > 1e-9:
                size *= 0.5
            x = x + size * step.reshape(count, 10)
            if -slope @ step < _CONVERGED:
                break
    return x
