"""Smallest contact force that is detected wherever it acts on the arm.

A force F at a point c loads the base sensor with F (f, c x f), f its direction. In units of the noise, with
base covariance S, the squared length of that reading is smallest for the least favourable moment, where it
is F^2 f' inv(S_ff) f with S_ff the block of the forces (Schur complement). So no place, no lever arm and no
direction needs more than

    F = L sqrt(largest eigenvalue of S_ff),

L being the length of the mean residuals that is detected. The readings of the other sensors only add to
that length. Joint torques alone give no such bound: each misses the forces that meet its axis, and all of
them the contacts on the base.
"""

import math

import numpy as np
from scipy.special import chndtrinc

DETECTION = 0.9
"""Probability of detection to which `Estimate.detectable` refers."""


def detected_length(energy: float, degrees_of_freedom: int, detection: float = DETECTION) -> float:
    """Length of the mean residuals, in units of their noise, that is detected with that probability.

    Twice the energy of the no-contact hypothesis is distributed as noncentral chi-square, with one degree of
    freedom per residual and the squared length of the mean residuals as its noncentrality (S. M. Kay,
    "Fundamentals of statistical signal processing: detection theory", 1998, section 2.2.3).

    Args:
        energy: Threshold on that energy.
        degrees_of_freedom: Number of residuals.
        detection: Probability of detection.
    """
    noncentrality = float(chndtrinc(2.0 * energy, degrees_of_freedom, 1.0 - detection))
    # Below zero, noise alone exceeds the threshold that often.
    return math.sqrt(max(noncentrality, 0.0))


def detectable_force(length: float, force_covariance: np.ndarray) -> float:
    """Smallest force that is detected at any place and in any direction [N].

    Args:
        length: `detected_length`.
        force_covariance: Covariance of the measured force: of a base sensor, or of a wrist sensor where only
            what it carries can be touched; shape (3, 3) [N^2].
    """
    return length * math.sqrt(max(float(np.linalg.eigvalsh(force_covariance)[-1]), 0.0))
