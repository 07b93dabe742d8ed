"""How well residuals fit what is known: each sensor by itself, and the two against each other."""

import math

from contactsense.arm import Arm
from contactsense.health import AGREEMENT, BASE, FORCE, TORQUE
from contactsense.memory import Memory
from kinematics.core import dot6
from robots.compiled import inlined_kernel


@inlined_kernel
def judge(arm: Arm, memory: Memory, scale: float) -> None:
    """Fill `fit`: mean square residuals in units of their variance, 1 if all is as stated; and `FORCE`, what
    the base sensor feels beyond the arm's own [N].

    `BASE` and `TORQUE` hold where nothing touches. `AGREEMENT` holds in a contact too: joints up to some link
    see what the base sensor sees and the others see nothing (theory, section 3), under the link that fits
    best.

    Args:
        arm, memory: After `contactsense.pipeline.energy_of_nothing` for this sample.
        scale: Factor on the variances of the scene's noise.
    """
    w, C, n = memory.base_wrench, memory.base_information, memory.torque.shape[0]
    total = 0.0
    for i in range(6):
        total += w[i] * dot6(C[i], w) / scale
    memory.fit[BASE] = total / 6.0
    memory.fit[FORCE] = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    blind = 0.0
    for j in range(n):
        blind += memory.torque[j] ** 2 / memory.torque_variance[j]
    memory.fit[TORQUE] = blind / n
    best, seen = blind, 0.0
    for j in range(n):
        s = memory.motion.screw[j]
        spread = memory.torque_variance[j]
        for i in range(6):
            spread += s[i] * dot6(memory.base_covariance[i], s) * scale
        seen += memory.match.residual[j] ** 2 / spread
        blind -= memory.torque[j] ** 2 / memory.torque_variance[j]
        best = min(best, seen + blind)
    memory.fit[AGREEMENT] = best / n
