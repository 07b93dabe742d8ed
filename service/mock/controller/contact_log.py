"""Log of collisions of the simulated arm with obstacles: peak force, depth and stopping distance of each."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from contactsense.service.mock.arm.obstacles import Obstacle
from contactsense.service.mock.physics.arm_simulation import ArmSimulation

OVER = 0.1
"""Time without touch after which a contact has ended [s]."""


@dataclass(slots=True)
class ContactRecord:
    """One contact of a link with an obstacle."""

    obstacle: str
    """Name of the obstacle; without a name, its kind."""
    link: str
    """The touched link."""
    start: float
    """Time of the first touch [s]."""
    end: float
    """Time of the last touch [s]."""
    speed: float
    """Speed of the contact point at the first touch [m/s]."""
    peak_force: float = 0.0
    """Largest force [N]."""
    peak_time: float = 0.0
    """Time of the largest force [s]."""
    peak_depth: float = 0.0
    """Largest penetration depth [m]."""
    impulse: float = 0.0
    """Integral of the force [Ns]."""
    stopping_distance: float = 0.0
    """Distance that the first touching point of the link moved after the touch [m]."""


@dataclass(slots=True)
class _Open:
    record: ContactRecord
    at_link: np.ndarray
    at_base: np.ndarray
    last: float = field(default=0.0)


class ContactLog:
    """All contacts with obstacles since the beginning.

    Args:
        obstacles: Obstacles in the cell.
        link_names: Names of all links; the tool is the last.
    """

    def __init__(self, obstacles: Sequence[Obstacle], link_names: tuple[str, ...]) -> None:
        self._names = [obstacle.name or obstacle.kind for obstacle in obstacles]
        self._links = link_names
        self._open: dict[tuple[int, int], _Open] = {}
        self.records: list[ContactRecord] = []
        """Contacts in the order in which they began."""

    def note(self, now: float, arm: ArmSimulation) -> None:
        """Record the contacts at one instant.

        Args:
            now: The instant [s].
            arm: The arm.
        """
        touching = arm.contacts
        if not touching and not self._open:
            return
        rotations, origins = arm.rotations, arm.origins
        for contact in touching:
            key = contact.obstacle, contact.link
            force = float(np.linalg.norm(contact.force))
            opened = self._open.get(key)
            if opened is None:
                R, o = rotations[contact.link], origins[contact.link]
                twist = arm.twist(contact.link)
                velocity = twist[:3] + np.cross(twist[3:], contact.point - o)
                record = ContactRecord(
                    obstacle=self._names[contact.obstacle],
                    link=self._links[contact.link],
                    start=now,
                    end=now,
                    speed=float(np.linalg.norm(velocity)),
                )
                opened = _Open(record, R.T @ (contact.point - o), contact.point, now)
                self._open[key] = opened
                self.records.append(record)
            record = opened.record
            record.impulse += force * (now - opened.last)
            record.end = opened.last = now
            record.peak_depth = max(record.peak_depth, contact.depth)
            if force > record.peak_force:
                record.peak_force, record.peak_time = force, now
        for (_, link), opened in self._open.items():
            point = origins[link] + rotations[link] @ opened.at_link
            gone = float(np.linalg.norm(point - opened.at_base))
            opened.record.stopping_distance = max(opened.record.stopping_distance, gone)
        self._open = {key: opened for key, opened in self._open.items() if now - opened.last < OVER}

    def save(self, path: Path) -> None:
        """Write all records to a JSON file.

        Raises:
            OSError: The file cannot be written.
        """
        path.write_text(json.dumps([asdict(record) for record in self.records], indent=1) + "\n")
