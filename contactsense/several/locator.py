"""Several contacts from one measurement of an arm at rest: what `Localizer.locate` calls for them."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from contactsense.answer import Composer
from contactsense.report import WIDTH
from contactsense.scene import Scene
from contactsense.several.answer import SetComposer
from contactsense.several.entry import explain_sets
from contactsense.several.memory import LISTED, MOST, Explanations, empty_several
from contactsense.types import Contact, Estimate
from contactsense.workspace import Workspace


class Given(NamedTuple):
    """A contact that is known already, base frame."""

    primitive: int
    """Number of the primitive among all of the arm."""
    point: np.ndarray
    """Place, shape (3,) [m]."""
    covariance: np.ndarray
    """Its covariance, shape (3, 3) [m^2]."""
    force: np.ndarray
    """Force before, shape (3,) [N]."""
    drift: float
    """Standard deviation of each component of its change since [N]; infinity: the force is free."""


class SetLocator:
    """Explains measurements by several contacts; owns the arrays that takes."""

    def __init__(self, scene: Scene, work: Workspace, buffers: tuple[Any, ...], composer: Composer) -> None:
        """For the scene of a `Localizer`, on its workspace."""
        self._arm = work.arm
        self._buffers = buffers
        self.several = empty_several(work.arm)
        self._rows = np.zeros((LISTED * MOST, WIDTH))
        self._answer = SetComposer(scene, composer)

    @property
    def found(self) -> Explanations:
        """What `fit` has found last."""
        return self.several.found

    def rows(self, k: int) -> np.ndarray:
        """The contacts of the k-th explanation that `fit` has listed, as in `contactsense.report`; a copy."""
        contacts = int(self.found.contacts[self.found.order[k]])
        return self._rows[k * MOST : k * MOST + contacts].copy()

    def fit(
        self, present: tuple[bool, bool, bool], most: int, known: Sequence[Given], bandwidth: float = math.inf
    ) -> tuple[int, int]:
        """Explain the sample that the workspace has taken last; `found` and `rows` have the result.

        Args:
            present: Which of base wrench, joint torques and wrist wrench were measured.
            most: Most contacts of an explanation, the known ones included.
            known: Contacts that are there already.
            bandwidth: Cut-off of the observers [Hz]; infinite for an arm at rest.

        Returns:
            Number of explanations in `rows`, and how many independent numbers the sensors say about the
            wrenches of the first one's contacts.
        """
        given = self.several.known
        for i, contact in enumerate(known):
            given.primitive[i], given.drift[i] = contact.primitive, contact.drift
            given.point[i], given.force[i] = contact.point, contact.force
            given.covariance[i] = contact.covariance
        listed, rank = explain_sets(
            *self._buffers, self.several, present, bandwidth, len(known), most, self._rows
        )
        return int(listed), int(rank)

    def explain(
        self, present: tuple[bool, bool, bool], contacts: int, known: Sequence[Contact], drift: float | None
    ) -> Estimate:
        """Explain a sample of an arm at rest, that the workspace has just taken, by at most `contacts`
        simultaneous contacts; arguments as in `Localizer.locate`, checked."""
        start = self._arm.surfaces.start
        given = [
            Given(
                int(start[contact.link_index]) + contact.primitive,
                contact.point_base,
                contact.covariance,
                contact.force_base,
                math.inf if drift is None else drift,
            )
            for contact in known
        ]
        listed, rank = self.fit(present, contacts, given)
        best = self.found.order[0]
        return self._answer.sets(
            0.0,
            [self.rows(k) for k in range(listed)],
            self.found.wrench[best],
            self.found.wrench_covariance[best],
            rank,
            len(known),
        )

    def check(self, contacts: int, known: Sequence[Contact], drift: float | None) -> None:
        """Refuse what cannot be asked for.

        Raises:
            ValueError: the message names the argument, what was expected and what came.
        """
        if not isinstance(contacts, int) or not 1 <= contacts <= MOST:
            raise ValueError(f"contacts: expected 1 to {MOST}, got {contacts!r}")
        if len(known) > contacts:
            raise ValueError(f"known: expected at most {contacts} (contacts), got {len(known)}")
        if drift is not None and not (math.isfinite(drift) and drift > 0.0):
            raise ValueError(f"drift: expected a positive number of N, got {drift!r}")
        start = self._arm.surfaces.start
        for i, contact in enumerate(known):
            if not isinstance(contact, Contact):
                raise ValueError(f"known[{i}]: expected a Contact, got {contact!r}")
            if not 0 <= contact.link_index < len(start) - 1:
                raise ValueError(
                    f"known[{i}].link_index: expected 0 to {len(start) - 2}, got {contact.link_index}"
                )
            count = int(start[contact.link_index + 1] - start[contact.link_index])
            if not 0 <= contact.primitive < count:
                expected = f"0 to {count - 1} on {contact.link}"
                raise ValueError(f"known[{i}].primitive: expected {expected}, got {contact.primitive}")
            for name, shape in (("point_base", (3,)), ("force_base", (3,)), ("covariance", (3, 3))):
                value = getattr(contact, name)
                if np.shape(value) != shape or not np.isfinite(value).all():
                    raise ValueError(
                        f"known[{i}].{name}: expected finite numbers of shape {shape}, got {value!r}"
                    )
