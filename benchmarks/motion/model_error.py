"""Errors of the estimator's model: wrong masses, and friction known with an error."""

from dataclasses import replace

import numpy as np

from contactsense.robots import Inertia, Robot
from contactsense.sensors.settings import Friction

MASS_ERROR = 0.02
"""All masses and inertias of the model are too large by this fraction."""
FRICTION_ERROR = 0.05
"""Friction is compensated with coefficients that are too small by this fraction."""
COULOMB = np.array([8.0, 8.0, 6.0, 2.0, 2.0, 2.0])
"""Coulomb friction of each joint, added to the ground truth, which has none [Nm]."""
VISCOUS = np.array([10.0, 10.0, 8.0, 2.0, 2.0, 2.0])
"""Viscous friction of each joint [Nm s/rad]."""
CREEP = 0.02
"""Width of the sign change of Coulomb friction [rad/s]: a step would contain frequencies that no sample rate
can resolve."""


def heavier(robot: Robot, share: float) -> Robot:
    """The same arm with all masses and inertias larger by that fraction."""
    factor = 1.0 + share
    return replace(
        robot,
        links=tuple(
            replace(
                link,
                inertia=Inertia(factor * link.inertia.mass, link.inertia.com, factor * link.inertia.tensor),
            )
            for link in robot.links
        ),
    )


def friction(qd: np.ndarray) -> np.ndarray:
    """Friction torque of each joint at velocities qd, shape (N, 6) [rad/s] -> [Nm]."""
    return np.asarray(COULOMB * np.tanh(qd / CREEP) + VISCOUS * qd)


def assumed_friction() -> Friction:
    """The estimator's model of `friction`: coefficients that are too small, with their standard deviation."""
    share = 1.0 - FRICTION_ERROR
    return Friction(
        coulomb=tuple(share * COULOMB),
        viscous=tuple(share * VISCOUS),
        velocity=CREEP,
        error=FRICTION_ERROR,
    )
