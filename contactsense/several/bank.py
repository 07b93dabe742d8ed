"""Sets of contacts that compete over time: each sample is explained by each of them, on one scale of
evidence."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsense.detection import single_level
from contactsense.scene import Scene
from contactsense.several.kept import Kept, given, keep
from contactsense.several.locator import SetLocator
from contactsense.workspace import Workspace

DRIFT = 2.0
"""Change of each component of a force between two priors, standard deviation [N]."""
CREEP = 5e-4
"""Change of a place between two priors, standard deviation [m]."""
SIZE = 4
"""Most sets that are kept."""
WORSE = 8.0
"""Sets whose log odds are worse by this much are dropped."""
SAME = 0.02
"""Contacts nearer to each other than this are the same [m]."""


class Rival(NamedTuple):
    """One set of simultaneous contacts."""

    contacts: tuple[Kept, ...]
    weight: float
    """Log probability, up to a constant that all have in common."""
    energy: float = 0.0
    """Half the squared residuals and priors that the last sample left, in units of the noise."""


class Fit(NamedTuple):
    """A set after a sample."""

    rival: Rival
    rows: np.ndarray
    """A row for each contact, see `contactsense.report`."""
    wrench: np.ndarray
    """Sum of the wrenches, shape (6,) [N, Nm]."""
    covariance: np.ndarray
    """Its covariance, shape (6, 6)."""
    rank: int
    """How many independent numbers the sensors say about the wrenches."""


class Bank:
    """Explains the samples of a stream by rivals."""

    def __init__(self, scene: Scene, work: Workspace, locator: SetLocator) -> None:
        """For the scene and the workspace of a `Localizer`."""
        self._scene, self._arm, self._memory, self._locator = scene, work.arm, work.memory, locator
        self._sizes = (6, work.arm.model.joints, 6)
        self.rivals: list[Rival] = []

    def limit(self, present: tuple[bool, bool, bool], count: int, drift: float) -> float:
        """Energy of known contacts that noise alone exceeds as seldom as the scene says.

        Each contact has as many unknowns as priors, and three priors more where its force is known.
        """
        freedom = sum(size for size, there in zip(self._sizes, present, strict=True) if there)
        if drift < math.inf:
            freedom += 3 * count
        return single_level(self._scene.false_alarms_per_hour, freedom, self._scene.bandwidth)

    def look(self, present: tuple[bool, bool, bool]) -> list[Fit]:
        """The rivals after this sample, the most probable first."""
        fits = []
        found = self._locator.found
        for one in self.rivals:
            known = given(self._memory.motion, one.contacts, DRIFT, 0.0)
            listed, rank = self._locator.fit(present, len(known), known, self._scene.bandwidth)
            if listed > 0:
                row = int(found.order[0])
                after = self._rival(one, row, 0.0)
                wrench, covariance = found.wrench[row].copy(), found.wrench_covariance[row].copy()
                fits.append(Fit(after, self._locator.rows(0), wrench, covariance, rank))
        return sorted(fits, key=lambda fit: -fit.rival.weight)

    def explain(
        self,
        present: tuple[bool, bool, bool],
        before: Sequence[Rival],
        most: int,
        drift: float,
        slide: float = 0.0,
        odds: float = 0.0,
    ) -> list[Rival]:
        """Sets of just `most` contacts after this sample, those of `before` among them, the best first.

        Args:
            present: Which sensors can be used.
            before: Sets before the sample.
            most: Number of contacts.
            drift: How much each component of their forces may have changed, standard deviation [N].
            slide: How much their places may have changed, likewise [m].
            odds: Log probability of all that.
        """
        after = []
        found = self._locator.found
        for one in before:
            known = given(self._memory.motion, one.contacts, drift, slide)
            listed, _ = self._locator.fit(present, most, known, self._scene.bandwidth)
            after += [
                self._rival(one, int(row), odds)
                for row in found.order[:listed]
                if found.contacts[row] == most
            ]
        return sorted(after, key=lambda one: -one.weight)

    def further(self, present: tuple[bool, bool, bool], before: Sequence[Rival]) -> list[Rival]:
        """Sets with one contact more, the forces of the others having changed little, or in any way."""
        count = len(before[0].contacts) + 1
        after = self.explain(present, before, count, DRIFT) + self.explain(present, before, count, math.inf)
        return sorted(after, key=lambda one: -one.weight)

    def settle(self, after: Sequence[Rival]) -> None:
        """Make the best of these sets the bank, as priors of the next samples."""
        best = max(one.weight for one in after)
        self.rivals = []
        for one in sorted(after, key=lambda one: -one.weight):
            if one.weight < best - WORSE or len(self.rivals) == SIZE:
                break
            if not any(self._alike(one, other) for other in self.rivals):
                creep = CREEP * CREEP * np.eye(3)
                contacts = tuple(c._replace(covariance=c.covariance + creep) for c in one.contacts)
                self.rivals.append(Rival(contacts, one.weight - best))

    def _rival(self, before: Rival, row: int, odds: float) -> Rival:
        """The explanation in a row of what was found, on one scale with all others."""
        found = self._locator.found
        return Rival(
            keep(self._arm, self._memory.motion, found, row),
            before.weight + odds + float(found.score[row]),
            float(found.energy[row]),
        )

    @staticmethod
    def _alike(one: Rival, other: Rival) -> bool:
        """Whether two sets have the same contacts."""
        return all(
            a.body == b.body and float(np.linalg.norm(a.point - b.point)) < SAME
            for a, b in zip(one.contacts, other.contacts, strict=True)
        )


def without(rivals: Sequence[Rival], i: int) -> list[Rival]:
    """The sets without contact i."""
    return [one._replace(contacts=one.contacts[:i] + one.contacts[i + 1 :]) for one in rivals]
