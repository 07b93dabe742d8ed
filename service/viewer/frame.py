"""What the viewer shows at one instant."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from contactsense.types import Estimate

HISTORY = 10.0
"""Length of the history of forces [s]."""
TRACKS = 3
"""Contacts at one time whose forces are kept: as many as a scene permits."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Magnitudes of the contact forces of the last `HISTORY` seconds; K instants."""

    t: np.ndarray
    """Time [s], shape (K,)."""
    force: np.ndarray
    """Force of the best explanation; where several contacts act, of each [N], shape (K, TRACKS). 0: none;
    NaN: unknown, as the estimate was `degraded`.
    """


@dataclass(frozen=True, eq=False)
class Frame:
    """One instant."""

    q: np.ndarray | None
    """Joint positions, shape (n,) [rad]; None: unknown."""
    estimate: Estimate | None
    """The estimate; None: there is none."""
    forces: Forces


@dataclass(frozen=True)
class Latch:
    """A collision that has not been acknowledged."""

    rule: str
    text: str
    """What happened, for a person."""


class ForceHistory:
    """Collects the forces of estimates. A time that goes back starts anew."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, list[float]]] = deque()

    def add(self, estimate: Estimate) -> None:
        """Add the forces of an estimate."""
        if self._rows and not self._rows[-1][0] < estimate.t:
            self._rows.clear()
        self._rows.append((estimate.t, forces_of(estimate)))
        while self._rows[0][0] < estimate.t - HISTORY:
            self._rows.popleft()

    def forces(self) -> Forces:
        """The history."""
        return Forces(
            np.array([t for t, _ in self._rows]),
            np.array([forces for _, forces in self._rows]).reshape(-1, TRACKS),
        )


def forces_of(estimate: Estimate) -> list[float]:
    """Magnitudes of the forces that act at the same time, `TRACKS` numbers, as in `Forces.force` [N]."""
    if estimate.status == "degraded":
        return [float("nan")] * TRACKS
    acting = estimate.contacts if estimate.status == "multiple" else estimate.contacts[:1]
    found = [float(np.linalg.norm(contact.force_base)) for contact in acting[:TRACKS]]
    return found + [0.0] * (TRACKS - len(found))
