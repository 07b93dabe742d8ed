"""Scripted touches as wrenches on the links of the moving arm."""

import numpy as np

from contactsense.service.mock.physics.arm_simulation import Push
from contactsense.service.mock.script import Contact, Script


class ScriptedPushes:
    """The script's contacts, timed by the controller's clock: they do not depend on the progress of the
    motion.

    Args:
        script: The script with the contacts.
        link_names: Names of all links; the tool is the last.
        loop: Whether to repeat the contacts after the script's end.
    """

    def __init__(self, script: Script, link_names: tuple[str, ...], *, loop: bool = False) -> None:
        self._contacts = [(contact, link_names.index(contact.link)) for contact in script.contacts]
        self._period = script.duration if loop else None

    def at(self, t: float, rotations: np.ndarray) -> list[Push]:
        """Return the wrenches at a given time.

        Args:
            t: Time since the beginning [s].
            rotations: Orientations of the links, base axes, shape (B, 3, 3).
        """
        since = t % self._period if self._period else t
        return [
            _push(contact, link, share, rotations[link])
            for contact, link in self._contacts
            if (share := level(since - contact.start, contact.duration, contact.ramp)) > 0.0
        ]


def level(since: float, duration: float, ramp: float) -> float:
    """Fraction of the full force at a time since the onset: 0 outside, raised cosine ramps, 1 in between."""
    edge = min(since, duration - since)  # distance to the nearer end
    if edge < 0.0:
        return 0.0
    return 1.0 if edge >= ramp else 0.5 - 0.5 * float(np.cos(np.pi * edge / ramp))


def _push(contact: Contact, link: int, share: float, rotation: np.ndarray) -> Push:
    normal = np.array(contact.normal or (0.0, 0.0, 0.0))
    normal /= np.linalg.norm(normal) or 1.0
    if contact.push is not None:
        force = -contact.push * normal
    elif contact.force_link is not None:
        force = np.array(contact.force_link)
    else:  # fixed in space while the link rotates
        force = rotation.T @ np.array(contact.force_base)
    moment = np.cross(contact.point, force) + contact.torsion * normal
    return Push(link, share * force, share * moment)
