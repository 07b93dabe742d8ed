"""Estimates made by hand."""

import numpy as np

from contactsense.robots.link_poses import link_poses
from contactsense.scene import Scene
from contactsense.types import Contact, Estimate, Status

POSTURE = np.array([0.4, -1.3, 1.6, -1.9, -1.57, 0.0])


def contact(scene: Scene, q: np.ndarray, link: int, point: np.ndarray, **more: float) -> Contact:
    """A push of 20 N inwards on a place of a link, given in the link's frame; the normal is radial."""
    pose = link_poses(scene.robot, q)[link]
    normal = pose[:3, 1]
    return Contact(
        scene.link_names[link], link, 0, more.get("probability", 1.0), point,
        pose[:3, :3] @ point + pose[:3, 3], normal,
        -20.0 * normal, 0.0, np.diag(np.full(3, more.get("deviation", 0.01) ** 2)), id=1,
    )  # fmt: skip


def estimate(scene: Scene, *contacts: Contact, status: Status = "contact", t: float = 0.0) -> Estimate:
    """An estimate with these contacts."""
    shares = np.zeros(len(scene.link_names))
    for each in contacts:
        shares[each.link_index] += each.probability
    return Estimate(
        t, status if contacts else "none", contacts, shares, np.zeros(6), np.eye(6), detectable=3.25,
        other=max(0.0, 1.0 - float(shares.sum())) if contacts else 0.0,
    )  # fmt: skip
