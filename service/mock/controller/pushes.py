"""Scripted touches as wrenches on the links of the moving arm."""

from dataclasses import dataclass

import numpy as np

from contactsense.service.mock.arm.script import Contact, Script
from contactsense.service.mock.physics.arm_simulation import Push


class ScriptedPushes:
    """The script's contacts, timed by the controller's clock: they do not depend on the progress of the
    motion.

    Args:
        script: The script with the contacts.
        link_names: Names of all links; the tool is the last.
        loop: Whether to repeat the contacts after the script's end.
    """

    def __init__(self, script: Script, link_names: tuple[str, ...], *, loop: bool = False) -> None:
        self._contacts = [
            _ScriptedPush.of(contact, link_names.index(contact.link)) for contact in script.contacts
        ]
        self._period = script.duration if loop else None

    def at(self, t: float, rotations: np.ndarray) -> list[Push]:
        """Return the wrenches at a given time.

        Args:
            t: Time since the beginning [s].
            rotations: Orientations of the links, base axes, shape (B, 3, 3).
        """
        since = t % self._period if self._period else t
        pushes = []
        for contact in self._contacts:
            share = level(since - contact.start, contact.duration, contact.ramp)
            if share > 0.0:
                full = contact.wrench(rotations)
                pushes.append(Push(contact.link, share * full[:3], share * full[3:]))
        return pushes


def level(since: float, duration: float, ramp: float) -> float:
    """Fraction of the full force at a time since the onset: 0 outside, raised cosine ramps, 1 in between."""
    edge = min(since, duration - since)  # distance to the nearer end
    if edge < 0.0:
        return 0.0
    return 1.0 if edge >= ramp else 0.5 - 0.5 * float(np.cos(np.pi * edge / ramp))


@dataclass(frozen=True)
class _ScriptedPush:
    """A contact of the script; what does not depend on the posture is computed once."""

    link: int
    start: float
    duration: float
    ramp: float
    fixed: np.ndarray
    """Wrench that rotates with the link, link frame, shape (6,) [N, Nm]."""
    force_base: np.ndarray | None
    """Force that is fixed in space while the link rotates, base axes, shape (3,) [N]."""
    arm: np.ndarray
    """Matrix that takes a force at the contact point to its moment, link frame, shape (3, 3) [m]."""

    @classmethod
    def of(cls, contact: Contact, link: int) -> "_ScriptedPush":
        normal = np.array(contact.normal or (0.0, 0.0, 0.0))
        normal /= np.linalg.norm(normal) or 1.0
        x, y, z = contact.point
        arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        force, force_base = np.zeros(3), None
        if contact.push is not None:
            force = -contact.push * normal
        elif contact.force_link is not None:
            force = np.array(contact.force_link)
        else:
            force_base = np.array(contact.force_base)
        fixed = np.concatenate((force, arm @ force + contact.torsion * normal))
        return cls(link, contact.start, contact.duration, contact.ramp, fixed, force_base, arm)

    def wrench(self, rotations: np.ndarray) -> np.ndarray:
        """The full wrench on the link, link frame, shape (6,) [N, Nm]."""
        if self.force_base is None:
            return self.fixed
        force = rotations[self.link].T @ self.force_base
        return np.asarray(self.fixed + np.concatenate((force, self.arm @ force)))
