"""Several contacts from one measurement of an arm at rest, for `Localizer.locate`."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from contactsense.multi_contact.arguments import check_arguments
from contactsense.multi_contact.contact_set_builder import ContactSetBuilder, ContactSets
from contactsense.multi_contact.energy_limit import energy_limit
from contactsense.multi_contact.explanations.marginal_probabilities import state_marginal_probabilities
from contactsense.multi_contact.kernels import explain_contact_sets
from contactsense.multi_contact.memory.buffers import (
    MAX_CONTACTS,
    MAX_EXPLANATIONS,
    Explanations,
    empty_multi_contact_buffers,
)
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.robots.jit.direct_call import direct_call
from contactsense.robots.surface.signed_distance_grid import Skin
from contactsense.runtime.buffers import Buffers, KernelBuffers
from contactsense.runtime.result_rows import WIDTH
from contactsense.scene import Scene
from contactsense.sensors.usable_sensors import Usable
from contactsense.types import Contact, Estimate

SEVERAL_CONTACTS: tuple[Any, ...] = explain_contact_sets, state_marginal_probabilities
"""Compiled functions that Python calls in search of several contacts."""


class KnownContact(NamedTuple):
    """A contact that is known before the measurement, base frame."""

    primitive: int
    """Index of the primitive among all of the arm."""
    point: np.ndarray
    """Point, shape (3,) [m]."""
    covariance: np.ndarray
    """Its covariance, shape (3, 3) [m^2]."""
    force: np.ndarray
    """Previous force, shape (3,) [N]."""
    torsion: float
    """Previous moment about the outward normal [Nm]."""


class MultiContactLocator:
    """Explains measurements by several contacts; owns the arrays of that search."""

    def __init__(
        self,
        scene: Scene,
        kernel_buffers: KernelBuffers,
        arrays: tuple[Buffers, Skin],
        estimate_builder: EstimateBuilder,
    ) -> None:
        """Prepare for the scene of a `Localizer` and its kernel buffers."""
        self._scene, self._constants = scene, kernel_buffers.constants
        self._arrays = arrays
        self.buffers = empty_multi_contact_buffers(kernel_buffers.constants)
        self._rows = np.zeros((MAX_EXPLANATIONS * MAX_CONTACTS, WIDTH))
        self._builder = ContactSetBuilder(scene, estimate_builder)
        self._search: Callable[..., tuple[int, int]] | None = None

    @property
    def explanations(self) -> Explanations:
        """Result of the last `fit`."""
        return self.buffers.explanations

    def best_rows(self) -> np.ndarray:
        """Contacts of the best explanation of the last `fit`, as in `contactsense.runtime.result_rows`; a
        copy."""
        return self._rows[: self.explanations.contacts[self.explanations.order[0]]].copy()

    def fit(
        self,
        present: Usable,
        max_contacts: int,
        known: Sequence[KnownContact],
        drift: float,
        bandwidth: float = math.inf,
    ) -> tuple[int, int]:
        """Explain the sample last taken by the kernels; `explanations` and `best_rows` return the result.

        Args:
            present: Which sensors have measured.
            max_contacts: Maximum number of contacts in a set, known ones included.
            known: Contacts known before.
            drift: Standard deviation of the change of each component of their forces [N]; infinity: their
                forces are new ones.
            bandwidth: Cut-off frequency of the observers [Hz]; infinite for an arm at rest.

        Returns:
            Number of explanations that are probable enough, and number of independent measurements of the
            wrenches of the first.
        """
        known_contacts = self.buffers.known
        for i, contact in enumerate(known):
            known_contacts.primitive[i], known_contacts.torsion[i] = contact.primitive, contact.torsion
            known_contacts.point[i], known_contacts.force[i] = contact.point, contact.force
            known_contacts.covariance[i] = contact.covariance
        sample = present, bandwidth, len(known), drift, max_contacts
        arguments = *self._arrays, self.buffers, *sample, self._rows
        if self._search is None:
            self._search = direct_call(explain_contact_sets, *arguments)
        return self._search(*arguments)

    def explain(
        self, present: Usable, contacts: int, known: Sequence[Contact], drift: float | None
    ) -> Estimate:
        """Estimate of at most `contacts` simultaneous contacts from the static sample last taken.

        Arguments as in `Localizer.locate`, already checked.
        """
        start = self._constants.surfaces.start
        known_contacts = [
            KnownContact(
                int(start[contact.link_index]) + contact.primitive,
                contact.point_base,
                contact.covariance,
                contact.force_base,
                contact.torsion,
            )
            for contact in known
        ]
        change = math.inf if drift is None else drift
        listed, rank = self.fit(present, int(contacts), known_contacts, change)
        order = self.explanations.order[:listed]
        best, counts = self.explanations.order[0], self.explanations.contacts[order]
        found = ContactSets(
            self._rows[: counts.sum()],
            counts,
            self.explanations.wrench[best],
            self.explanations.wrench_covariance[best],
            rank,
        )
        limit = energy_limit(self._scene, present, len(known), change)
        is_explained = listed == 0 or bool(self.explanations.energy[best] <= limit)
        return self._builder.sets(0.0, found, len(known), is_explained=is_explained)

    def check(self, contacts: int, known: Sequence[Contact], drift: float | None) -> None:
        """Check the arguments of `Localizer.locate`, see `check_arguments`."""
        check_arguments(contacts, known, drift, self._constants.surfaces.start)
