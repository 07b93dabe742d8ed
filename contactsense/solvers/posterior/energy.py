"""Energy of a contact on one primitive and its Gauss-Newton equations, for arrays. The formulas are in
`contactsense.solvers.posterior.equations`."""

import math

import numpy as np

from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import blocks
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.solvers.posterior.contact_prior import Contact, Prior, SearchBuffers
from contactsense.solvers.posterior.equations import (
    Inflation,
    energy_of,
    inflate,
)
from contactsense.solvers.posterior.gauss_newton import gauss_newton_equations


@fused_kernel
def inflate_by_surface_deviation(L: np.ndarray, prior: Prior, contact: Contact) -> Inflation:
    """`inflate` for an information matrix of shape (6, 6) and the prior's standard deviation."""
    found: Inflation = inflate(blocks(L), prior.surface_deviation * prior.surface_deviation, contact)
    return found


@fused_kernel
def energy_at(w: np.ndarray, L: np.ndarray, prior: Prior, inflation: Inflation, contact: Contact) -> float:
    """Energy of a contact; infinite if the force does not push.

    `inflation` is the result of `inflate_by_surface_deviation`. Other arguments as in
    `contactsense.solvers.posterior.mode.find_posterior_mode`.
    """
    energy, normal_force, _ = energy_of(
        _six(w), blocks(L), prior.friction_ratio, prior.torsion_lever, prior.force, inflation, contact
    )
    return math.inf if normal_force <= 0.0 else float(energy)


@fused_kernel
def linearize(
    w: np.ndarray,
    L: np.ndarray,
    prior: Prior,
    inflation: Inflation,
    W: Six,
    contact: Contact,
    buffers: SearchBuffers,
) -> float:
    """Compute gradient and Gauss-Newton matrix of the energy, written to `buffers`; returns the energy of a
    contact that pushes.

    W: shape operator of the surface at c (upper triangle, six floats) [1/m]. Other arguments as in
    `energy_at`.
    """
    n, f = contact.normal, contact.force
    log_force = math.log(-(f[0] * n[0] + f[1] * n[1] + f[2] * n[2]) / prior.force)
    matrix, gradient, (t1, t2), energy = gauss_newton_equations(
        _six(w), blocks(L), prior.friction_ratio, prior.torsion_lever, inflation, W, contact, log_force
    )
    frame, H, g = buffers.frame, buffers.normal_equations, buffers.gradient
    for i in range(3):
        frame[i, 0], frame[i, 1], frame[i, 2] = n[i], t1[i], t2[i]
    H[0, 0], H[0, 1], H[0, 2], H[0, 3], H[0, 4], H[0, 5] = matrix[:6]
    H[1, 1], H[1, 2], H[1, 3], H[1, 4], H[1, 5] = matrix[6:11]
    H[2, 2], H[2, 3], H[2, 4], H[2, 5] = matrix[11:15]
    H[3, 3], H[3, 4], H[3, 5] = matrix[15:18]
    H[4, 4], H[4, 5], H[5, 5] = matrix[18:]
    g[0], g[1], g[2], g[3], g[4], g[5] = gradient
    return float(energy)


@inlined_fused_kernel
def _six(a: np.ndarray) -> Six:
    """The six numbers of an array."""
    return a[0], a[1], a[2], a[3], a[4], a[5]
