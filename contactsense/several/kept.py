"""What a live stream keeps of its contacts from sample to sample, and how probable that was beforehand."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm
from contactsense.energy import TAIL, Prior
from contactsense.several.locator import Given
from contactsense.several.memory import Explanations
from kinematics.model import Motion

_LEAST_FORCE = 0.1
"""Normal force that a force before counts as having at least [N]."""


class Kept(NamedTuple):
    """One contact, in the frame of the body that carries it."""

    primitive: int
    """Number of the primitive among all of the arm."""
    body: int
    point: np.ndarray
    """Place, shape (3,) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (3,)."""
    covariance: np.ndarray
    """Covariance of the place, shape (3, 3) [m^2]."""
    force: np.ndarray
    """Force on the robot, shape (3,) [N]."""


def keep(arm: Arm, motion: Motion, found: Explanations, row: int) -> tuple[Kept, ...]:
    """The contacts of an explanation, row `row` of `found`."""
    return tuple(
        kept(
            arm,
            motion,
            int(found.primitive[row, i]),
            found.point[row, i],
            found.normal[row, i],
            found.covariance[row, i],
            found.force[row, i],
        )
        for i in range(int(found.contacts[row]))
    )


def kept(
    arm: Arm,
    motion: Motion,
    primitive: int,
    point: np.ndarray,
    normal: np.ndarray,
    covariance: np.ndarray,
    force: np.ndarray,
) -> Kept:
    """A contact given in the base frame."""
    body = int(arm.sensors.depth[arm.surfaces.link[primitive]])
    R = motion.rotation[body]
    return Kept(
        primitive, body, (point - motion.origin[body]) @ R, normal @ R, R.T @ covariance @ R, force @ R
    )


def given(motion: Motion, contacts: Sequence[Kept], drift: float, slide: float) -> list[Given]:
    """Contacts as they are known to the next sample.

    Args:
        motion: Where the bodies are now.
        contacts: What was kept.
        drift: Standard deviation of each component of the forces' change since [N].
        slide: Standard deviation of the places' change since, along each axis [m].
    """
    wider = slide * slide * np.eye(3)
    known = []
    for contact in contacts:
        R = motion.rotation[contact.body]
        known.append(
            Given(
                contact.primitive,
                R @ contact.point + motion.origin[contact.body],
                R @ contact.covariance @ R.T + wider,
                R @ contact.force,
                drift,
            )
        )
    return known


def log_known(prior: Prior, contacts: Sequence[Kept], drift: float, slide: float) -> float:
    """What knowing the contacts beforehand adds to the log evidence of an explanation by them.

    The search takes every place as one of all the surface, and every force as one of all that are usual; what
    is known comes on top as a factor exp(-d^2 / 2). So that explanations with and without known contacts
    compete on one scale, the product of both is brought back to one whole.
    """
    total = 0.0
    for contact in contacts:
        n = contact.normal
        across = np.eye(3) - np.outer(n, n)
        flat = across @ contact.covariance @ across + slide * slide * across + np.outer(n, n)
        total += math.log(prior.area / (2.0 * math.pi)) - 0.5 * float(np.linalg.slogdet(flat)[1])
        if drift < math.inf:
            push = max(-float(contact.force @ n), _LEAST_FORCE)
            lean = max(float(contact.force @ contact.force) - push * push, 0.0) / (prior.lean * push) ** 2
            cost = math.log(push / prior.force) ** 2 + (TAIL + 2.0) * math.log1p(lean / TAIL)
            width = 3.0 * math.log(drift) - math.log(push**3 * prior.lean**2)
            total -= min(width - 0.5 * cost, 0.0)
    return total
