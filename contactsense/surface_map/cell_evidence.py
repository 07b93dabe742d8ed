"""Evidence of the surface's cells for readings, linear in the readings' errors, and the place in each cell.

In every cell the readings are linear in relative force, friction ratios, torsion ratio and a step within the
cell, all with normal priors. What this leaves of the readings is the distance between two places as the
sensors tell them apart; with the width of the posterior it gives the evidence of the cell. With the nonlinear
model, `contactsense.localization.laplace_evidence` does the same.
"""

from typing import NamedTuple

import numpy as np

from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior
from contactsense.surface_map.place_error import place_covariance, place_gain, push_jacobian, step_jacobian
from contactsense.surface_map.places import Places

_TAIL_WEIGHT = (STUDENT_DOF + 2.0) / STUDENT_DOF
"""Information of the Student t prior of the friction ratio at its mode."""
_ROOTS, _FORCE, _RATIOS, _TORSION, _STEPS = slice(0, 6), 6, slice(7, 9), 9, slice(10, 12)
EXPECTED = 12
"""Row of `CellEvidence.projection` that holds the cell's expected readings."""
_COLUMNS = 13
"""Per cell: six whose squares sum to the decrease of the energy; the most probable relative force, friction
ratios, torsion ratio and steps; the product with the expected readings."""


class CellEvidence(NamedTuple):
    """C cells as hypotheses about a reading."""

    cells: Places
    """Places and shapes of the cells."""
    projection: np.ndarray
    """Linear functions of the readings, see `_COLUMNS`, shape (C, _COLUMNS, rows)."""
    origin: np.ndarray
    """Their values for the cell's expected readings, shape (C, _COLUMNS)."""
    log_prior: np.ndarray
    """Logarithms of prior probability and posterior width, minus half the squared expected readings, shape
    (C,)."""
    measured: np.ndarray
    """Effective number of unknowns that the sensors measure, rather than the priors, shape (C,)."""
    variance: np.ndarray
    """Variance of the place within the cell, sum of both tangents, shape (C,) [m^2]."""
    gain: np.ndarray
    """Step to the most probable place near the cell per change of readings, shape (C, 2, rows) [m]."""
    deviation: np.ndarray
    """Largest standard deviation that the localizer states for a place there, shape (C,) [m]."""


class Posterior(NamedTuple):
    """Posterior of K readings over C cells."""

    evidence: np.ndarray
    """Log evidence, -infinity where only a pull explains the reading, shape (C, K)."""
    step: np.ndarray
    """Most probable step within the cell along its tangents, shape (C, 2, K) [m]."""


def cell_evidence(response: np.ndarray, cells: Places, prior: Prior, force: float) -> CellEvidence:
    """Prepare cells as hypotheses.

    Args:
        response: `sensor_response` of each cell's link, shape (C, rows, 6).
        cells: C cells of the surface.
        prior: Of contacts.
        force: Normal force about which the readings are linear, and the median of its prior [N].
    """
    push = push_jacobian(response, cells, prior, force)
    step = step_jacobian(response, cells, force, turning=False) * cells.spread[:, None, None]
    jacobian = np.concatenate((push, step), axis=2)
    expected = push[:, :, 0]
    of_prior = np.diag([1.0, _TAIL_WEIGHT, _TAIL_WEIGHT, 1.0, 1.0, 1.0])
    information = of_prior + np.einsum("cik,cil->ckl", jacobian, jacobian)
    covariance = np.linalg.inv(information)
    found = covariance @ jacobian.transpose(0, 2, 1)
    projection = np.concatenate(
        (
            np.linalg.cholesky(covariance).transpose(0, 2, 1) @ jacobian.transpose(0, 2, 1),
            found[:, :4],
            found[:, 4:] * cells.spread[:, None, None],
            expected[:, None],
        ),
        axis=1,
    )
    origin = np.einsum("ckr,cr->ck", projection, expected)
    origin[:, EXPECTED] = 0.0
    width = 0.5 * np.linalg.slogdet(information)[1]
    stated = place_covariance(response, cells, prior, force, 2.0 * cells.friction_ratio)[1]
    return CellEvidence(
        cells=cells,
        projection=projection,
        origin=origin,
        log_prior=np.log(cells.share)
        + prior.log_link_density[cells.link]
        - width
        - 0.5 * (expected**2).sum(axis=1),
        measured=6.0 - np.einsum("ckl,kl->c", covariance, of_prior),
        variance=(covariance[:, 4, 4] + covariance[:, 5, 5]) * cells.spread**2,
        gain=place_gain(response, cells, prior, force),
        deviation=np.sqrt(np.linalg.eigvalsh(stated)[:, 1]),
    )


def subset(of: CellEvidence, chosen: np.ndarray) -> CellEvidence:
    """The cells with the indices or the mask `chosen`."""
    cells = Places(*(values[chosen] for values in of.cells))
    return CellEvidence(cells, *(values[chosen] for values in of[1:]))


def posterior(of: CellEvidence, readings: np.ndarray) -> Posterior:
    """Posterior of readings over the cells.

    Args:
        of: The cells.
        readings: In units of the noise, shape (K, rows).
    """
    values = of.projection.reshape(-1, of.projection.shape[2]) @ readings.T
    values = values.reshape(len(of.origin), _COLUMNS, -1) - of.origin[:, :, None]
    evidence = 0.5 * np.einsum("ckn,ckn->cn", values[:, _ROOTS], values[:, _ROOTS])
    evidence += values[:, EXPECTED] + of.log_prior[:, None] - 0.5 * (readings**2).sum(axis=1)
    force = values[:, _FORCE]
    pushing = force > -1.0
    log_force = np.log1p(np.where(pushing, force, 0.0))
    # The priors at the most probable values: log-normal and Student t; the ratios are to the force found.
    # So is the lever that a step adds.
    ratio, torsion, step = values[:, _RATIOS], values[:, _TORSION], values[:, _STEPS]
    linear = torsion**2 + (step**2).sum(axis=1) / of.cells.spread[:, None] ** 2
    ratio = (ratio**2).sum(axis=1)
    scale = np.exp(-2.0 * log_force)
    evidence -= 0.5 * (log_force**2 - force**2 + (scale - 1.0) * linear)
    evidence -= 0.5 * ((STUDENT_DOF + 2.0) * np.log1p(scale * ratio / STUDENT_DOF) - _TAIL_WEIGHT * ratio)
    # What is measured of the ratios and the step is more exact for a larger force.
    evidence -= of.measured[:, None] * log_force
    return Posterior(np.where(pushing, evidence, -np.inf), step * np.exp(-log_force)[:, None])
