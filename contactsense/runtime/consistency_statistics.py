"""Statistics of the residuals: each sensor against the model, and the two sensors against each other."""

import math

from contactsense.kinematics.linalg.ldl import half_squared_norm
from contactsense.kinematics.spatial import quadratic_form
from contactsense.residuals.sensor_consistency import AGREEMENT, FORCE
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.stream_state import BASE, TORQUE


@inlined_kernel
def consistency_statistics(constants: Constants, state: State, variance_ratio: float) -> None:
    """Fill `State.statistics`: mean squared residuals in units of their variance (1 where model and noise are
    as stated), and `FORCE`, the external force at the base sensor [N].

    `BASE` and `TORQUE` are meaningful in free motion. `AGREEMENT` is meaningful in contact too: joints
    proximal to some link measure the wrench that the base sensor measures, the distal ones measure nothing
    (`contactsense.isolation.link_hypotheses`); the statistic is that of the link that fits best.

    Args:
        constants, state: After `contactsense.runtime.no_contact_hypothesis.energy_without_contact` for this
            sample.
        variance_ratio: Variance of the residuals over that of one sample's noise.
    """
    w, n = state.base_wrench, state.torque.shape[0]
    # Each sensor against its stated noise, also where larger noise is followed.
    base, torque = state.noise_scale.noise[BASE], state.noise_scale.noise[TORQUE]
    state.statistics[BASE] = half_squared_norm(state.base_covariance, w) / variance_ratio / 3.0
    state.statistics[BASE] *= base.scale
    state.statistics[FORCE] = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    distal, stated = 0.0, 0.0
    for j in range(n):
        distal += state.torque[j] ** 2 / state.torque_variance[j]
        excess = (torque.scale - 1.0) * constants.sensors.torque_variance[j] * variance_ratio
        stated += state.torque[j] ** 2 / (state.torque_variance[j] - excess)
    state.statistics[TORQUE] = stated / n
    best, proximal = distal, 0.0
    for j in range(n):
        base_variance = quadratic_form(state.base_covariance, state.motion.screw[j]) * variance_ratio
        variance = state.torque_variance[j] + base_variance
        proximal += state.observers.torque_difference.residual[j] ** 2 / variance
        distal -= state.torque[j] ** 2 / state.torque_variance[j]
        best = min(best, proximal + distal)
    state.statistics[AGREEMENT] = best / n
