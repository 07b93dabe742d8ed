"""Probability of naming the touched link, from the evidence of the links for the readings of a push.

For the mean readings of a push at each place, every surface cell of every link is a hypothesis: the readings
are linear in relative force, friction ratios, torsion ratio and a step within the cell, all with normal
priors. The residual that this leaves is the distance between the two places as the sensors tell them apart;
with the width of the posterior it gives the evidence of the cell. The sum over a link's cells is the evidence
of the link, and its share of the evidence of all links is the probability. For one measurement and with the
nonlinear model, `contactsense.localization.laplace_evidence` does the same.
"""

import numpy as np
from scipy.special import logsumexp

from contactsense.localization.posterior import STUDENT_DOF, Prior
from contactsense.surface_map.place_error import push_jacobian, step_jacobian
from contactsense.surface_map.places import Places

_ROWS = 128
"""Places per block: bounds the memory."""


def link_probabilities(
    mean: np.ndarray, response: np.ndarray, cells: Places, prior: Prior, force: float, links: int
) -> np.ndarray:
    """Probability of each link given the mean readings of a push.

    Args:
        mean: Readings of the pushes in units of the noise, shape (N, rows).
        response: `sensor_response` of each cell's link, shape (C, rows, 6).
        cells: C cells of the surface, the hypotheses.
        prior: Of contacts.
        force: Normal force of the pushes [N].
        links: Number of links.

    Returns:
        Shape (N, links).
    """
    push = push_jacobian(response, cells, prior, force)
    step = step_jacobian(response, cells, force, turning=False) * cells.spread[:, None, None]
    jacobian = np.concatenate((push, step), axis=2)
    # The mode of the prior is a push of that force along the normal.
    expected = push[:, :, 0]
    information = np.eye(6) + np.einsum("cik,cil->ckl", jacobian, jacobian)
    covariance = np.linalg.inv(information)
    width = 0.5 * np.linalg.slogdet(information)[1]
    offset = np.einsum("ci,cik->ck", expected, jacobian)
    probability = np.zeros((len(mean), links))
    for first in range(0, len(mean), _ROWS):
        block = mean[first : first + _ROWS]
        squared = (block**2).sum(axis=1)[:, None] - 2.0 * block @ expected.T + (expected**2).sum(axis=1)[None]
        gradient = np.tensordot(block, jacobian, axes=(1, 1)) - offset
        found = np.einsum("nck,ckl->ncl", gradient, covariance)
        energy = 0.5 * (squared - (gradient * found).sum(axis=2))
        # The friction ratio has a Student t prior, whose tails are heavier.
        ratio = found[:, :, 1] ** 2 + found[:, :, 2] ** 2
        energy += 0.5 * ((STUDENT_DOF + 2.0) * np.log1p(ratio / STUDENT_DOF) - ratio)
        evidence = np.log(cells.share) - energy - width
        evidence[found[:, :, 0] <= -1.0] = -np.inf
        of_link = np.stack([_sum(evidence[:, cells.link == link]) for link in range(links)], axis=1)
        probability[first : first + _ROWS] = np.exp(of_link - logsumexp(of_link, axis=1, keepdims=True))
    return probability


def _sum(evidence: np.ndarray) -> np.ndarray:
    """Log of the sum over cells, -infinity without cells, shape (N,)."""
    if evidence.shape[1] == 0:
        return np.full(len(evidence), -np.inf)
    return np.asarray(logsumexp(evidence, axis=1))
