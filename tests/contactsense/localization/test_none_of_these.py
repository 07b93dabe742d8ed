"""The evidence of "none of these", against dense linear algebra."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense.isolation.link_hypotheses import Hypotheses
from contactsense.kinematics.model import empty_motion
from contactsense.localization.none_of_these import (
    NONE_OF_THESE_LEVER,
    NONE_OF_THESE_PROBABILITY,
    none_of_these_evidence,
)
from contactsense.localization.surface.surface_moments import BROAD_FORCE, SMALLEST_MOMENT, SurfaceMoments
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.solvers.posterior.contact_prior import Prior, SearchBuffers
from contactsense.solvers.posterior.mode import ENERGY_CUTOFF

LINKS = 3
PRIOR = Prior(
    friction_ratio=0.25,
    torsion_lever=0.002,
    surface_deviation=0.001,
    force=10.0,
    clearance=0.0,
    area=0.5,
    log_link_density=np.zeros(LINKS),
)


def _skew(v: np.ndarray) -> np.ndarray:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _gaussian(w: np.ndarray, L: np.ndarray, C: np.ndarray) -> tuple[float, np.ndarray]:
    """Log of the integral of exp(-1/2 (x - w) L (x - w)) over x ~ N(0, C), and the most probable x."""
    energy = 0.5 * w @ L @ np.linalg.solve(np.eye(6) + C @ L, w)
    return -energy - 0.5 * np.linalg.slogdet(np.eye(6) + C @ L)[1], np.linalg.solve(
        np.linalg.inv(C) + L, L @ w
    )


@pytest.mark.parametrize("seed", range(16))
@pytest.mark.parametrize("log_weight", [-math.inf, -30.0, 0.4])
def test_it_is_that_of_normal_variables(seed: int, log_weight: float) -> None:
    chance = np.random.default_rng(seed)
    motion, depth = empty_motion(LINKS - 1), np.arange(LINKS)
    motion.rotation[:] = Rotation.random(LINKS, rng=chance).as_matrix()
    motion.origin[:] = chance.uniform(-0.5, 0.5, (LINKS, 3))
    roots = chance.standard_normal((LINKS, 6, 6)) * ([1.0] * 3 + [3.0] * 3)
    information = np.einsum("lij,lkj->lik", roots, roots) * 10.0 ** chance.uniform(-2, 4)
    hypotheses = Hypotheses(
        wrench=chance.standard_normal((LINKS, 6)) * ([8.0] * 3 + [3.0] * 3),
        covariance=np.linalg.inv(information),
        information=information,
        energy=chance.uniform(0.0, 5.0, LINKS),
        log_evidence=np.zeros(LINKS),
    )
    spread = chance.standard_normal((LINKS, 3, 3)) * 0.1
    left_out = SurfaceMoments(
        np.array([-math.inf, log_weight, -math.inf]),
        chance.uniform(-0.2, 0.2, (LINKS, 3)),
        np.einsum("lij,lkj->lik", spread, spread),
    )
    found, is_touch = none_of_these_evidence(
        left_out, depth, motion, hypotheses, 2, PRIOR, zeros(SearchBuffers)
    )

    F = BROAD_FORCE * PRIOR.force
    broad = np.diag([F**2] * 3 + [(NONE_OF_THESE_LEVER * F) ** 2] * 3)
    expected = math.log(NONE_OF_THESE_PROBABILITY / (1.0 - NONE_OF_THESE_PROBABILITY))
    expected += _gaussian(hypotheses.wrench[2], information[2], broad)[0] - hypotheses.energy[2]
    if log_weight - hypotheses.energy[1] >= expected - ENERGY_CUTOFF:
        w, L, R = hypotheses.wrench[1], information[1], motion.rotation[1]
        f = _gaussian(w, L, broad)[1][:3]
        squared_lever = PRIOR.torsion_lever**2 + PRIOR.surface_deviation**2
        moment = _skew(f) @ R @ left_out.covariance[1] @ R.T @ _skew(f).T
        moment += (SMALLEST_MOMENT**2 + squared_lever * (f @ f)) * np.eye(3)
        J = np.eye(6)
        J[3:, :3] = _skew(motion.origin[1] + R @ left_out.centre[1])
        prior = np.zeros((6, 6))
        prior[:3, :3], prior[3:, 3:] = F**2 * np.eye(3), moment
        touch = log_weight + _gaussian(w, L, J @ prior @ J.T)[0] - hypotheses.energy[1]
        assert is_touch == (touch > expected)
        expected = np.logaddexp(expected, touch)
    else:
        assert not is_touch
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-7)
