"""Contacts of a stream in link frames, carried from sample to sample."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.multi_contact.locator import KnownContact
from contactsense.multi_contact.memory.buffers import Explanations
from contactsense.scene_model.constants import Constants


class TrackedContact(NamedTuple):
    """One contact, in the frame of the link that carries it."""

    primitive: int
    """Index of the primitive among all of the arm."""
    body: int
    point: np.ndarray
    """Point, shape (3,) [m]."""
    normal: np.ndarray
    """Outward unit normal, shape (3,)."""
    covariance: np.ndarray
    """Covariance of the point, shape (3, 3) [m^2]."""
    force: np.ndarray
    """Force on the robot, shape (3,) [N]."""


def contacts_in_link_frame(
    constants: Constants, motion: Motion, explanations: Explanations, row: int
) -> tuple[TrackedContact, ...]:
    """Contacts of an explanation (row `row`), in link frames."""
    return tuple(
        tracked_contact(
            constants,
            motion,
            int(explanations.primitive[row, i]),
            explanations.point[row, i],
            explanations.normal[row, i],
            explanations.covariance[row, i],
            explanations.force[row, i],
        )
        for i in range(int(explanations.contacts[row]))
    )


def tracked_contact(
    constants: Constants,
    motion: Motion,
    primitive: int,
    point: np.ndarray,
    normal: np.ndarray,
    covariance: np.ndarray,
    force: np.ndarray,
) -> TrackedContact:
    """Convert a contact from the base frame to its link frame.

    Args:
        constants: What the kernels know of the scene.
        motion: Poses of the links.
        primitive: Index of the contact's primitive among all of the arm.
        point, normal, force: Shapes (3,) [m, -, N].
        covariance: Of the point, shape (3, 3) [m^2].
    """
    body = int(constants.sensors.depth[constants.surfaces.link[primitive]])
    R = motion.rotation[body]
    return TrackedContact(
        primitive, body, (point - motion.origin[body]) @ R, normal @ R, R.T @ covariance @ R, force @ R
    )


def predict_known_contacts(
    motion: Motion, contacts: Sequence[TrackedContact], slide: float
) -> list[KnownContact]:
    """Predict the contacts at the next sample, base frame.

    Args:
        motion: Current poses.
        contacts: Contacts of the previous sample.
        slide: Standard deviation of the change of the points along each axis [m].
    """
    slide_covariance = slide * slide * np.eye(3)
    known = []
    for contact in contacts:
        R = motion.rotation[contact.body]
        known.append(
            KnownContact(
                contact.primitive,
                R @ contact.point + motion.origin[contact.body],
                R @ contact.covariance @ R.T + slide_covariance,
                R @ contact.force,
                # Not tracked: torsion keeps the prior of a new one.
                0.0,
            )
        )
    return known
