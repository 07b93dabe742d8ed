"""What a live stream keeps of its contacts from sample to sample."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm
from contactsense.several.locator import Given
from contactsense.several.memory import Explanations
from kinematics.model import Motion


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
