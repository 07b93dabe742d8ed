"""Several contacts from one measurement of an arm at rest: what `Localizer.locate` calls for them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from contactsense.answer import Composer
from contactsense.report import WIDTH
from contactsense.scene import Scene
from contactsense.several.answer import SetComposer
from contactsense.several.entry import explain_sets
from contactsense.several.memory import LISTED, MOST, empty_several
from contactsense.types import Contact, Estimate
from contactsense.workspace import Workspace


class SetLocator:
    """Explains measurements by several contacts; owns the arrays that takes."""

    def __init__(self, scene: Scene, work: Workspace, buffers: tuple[Any, ...], composer: Composer) -> None:
        """For the scene of a `Localizer`, on its workspace."""
        self._arm = work.arm
        self._buffers = buffers
        self._several = empty_several(work.arm)
        self._rows = np.zeros((LISTED * MOST, WIDTH))
        self._answer = SetComposer(scene, composer)

    def explain(
        self,
        t: float,
        present: tuple[bool, bool, bool],
        contacts: int,
        known: Sequence[Contact],
        drift: float | None,
        bandwidth: float = math.inf,
    ) -> Estimate:
        """Explain the sample that the workspace has taken last by at most `contacts` simultaneous contacts.

        Args:
            t: Its time [s].
            present: Which of base wrench, joint torques and wrist wrench were measured.
            contacts, known, drift: As in `Localizer.locate`, checked.
            bandwidth: Cut-off of the observers [Hz]; infinite for an arm at rest.
        """
        given = self._several.known
        for i, contact in enumerate(known):
            given.primitive[i] = self._arm.surfaces.start[contact.link_index] + contact.primitive
            given.point[i] = contact.point_base
            given.covariance[i] = contact.covariance
            given.force[i] = contact.force_base
            given.drift[i] = math.inf if drift is None else drift
        listed, rank = explain_sets(
            *self._buffers, self._several, present, bandwidth, len(known), contacts, self._rows
        )
        return self._answer.sets(t, self._several, self._rows, listed, rank, len(known))

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
