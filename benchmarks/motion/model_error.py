"""Errors of the estimator's model: wrong masses, and friction known with an error."""

from dataclasses import replace

import numpy as np

from contactsense import Scene
from contactsense.robots import Inertia, Link, Robot
from contactsense.sensors.settings import Friction

MASS_ERROR = 0.02
"""All masses and inertias of the model are too large by this fraction."""
LEAST_MASS = 0.4
"""Least mass that is drawn, as a fraction of the true one: errors far beyond those of real arms are none."""
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
        links=tuple(_with_mass(link, factor) for link in robot.links),
    )


def _with_mass(link: Link, factor: float) -> Link:
    """The same link with mass and inertia times that factor."""
    inertia = link.inertia
    return replace(link, inertia=Inertia(factor * inertia.mass, inertia.com, factor * inertia.tensor))


def with_drawn_masses(scene: Scene, share: float, seed: int) -> Scene:
    """The same scene with masses that are wrong by that standard deviation, each by another fraction, as its
    `inertia_error` then states. No mass is less than `LEAST_MASS` of the true one."""
    chance, robot = np.random.default_rng(seed), scene.robot
    factors = np.maximum(1.0 + share * chance.standard_normal(len(robot.links)), LEAST_MASS)
    links = tuple(_with_mass(link, factor) for link, factor in zip(robot.links, factors, strict=True))
    return scene.model_copy(update={"robot": replace(robot, links=links), "inertia_error": share})


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
