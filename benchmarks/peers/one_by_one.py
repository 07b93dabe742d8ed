"""Our method for contacts that start one after another: each is located given those found before."""

import time
from typing import NamedTuple

import numpy as np

from contactsense import Contact, Localizer, Scene
from contactsense.benchmarks.peers.exploration_filter import Found


class TrackedAnswers(NamedTuple):
    """Estimates after each contact, and their computing time."""

    found: Found
    seconds: np.ndarray
    """Median time of an estimate after each contact, shape (T,) [s]."""


class OneByOne:
    """`Localizer.locate` with the contacts found before as `known`."""

    def __init__(self, scene: Scene, contacts: int, drift: float | None) -> None:
        """For a scene's arm.

        Args:
            scene: Sensors and their noise.
            contacts: Maximum number of simultaneous contacts.
            drift: Standard deviation of the change of each component of the previous forces [N]; None: they
                are free.
        """
        held = "forces free" if drift is None else f"forces within {drift:g} N"
        self.name = f"ours, {held}"
        self._localizer = Localizer(scene)
        self._contacts, self._drift = contacts, drift

    def follow(self, q: np.ndarray, base_wrench: np.ndarray, joint_torque: np.ndarray) -> TrackedAnswers:
        """One answer for each of T measurements in each of N postures.

        Args:
            q: Shape (N, n) [rad].
            base_wrench, joint_torque: External parts, shapes (N, T, 6) and (N, T, n).
        """
        runs, steps = base_wrench.shape[:2]
        shape = (runs, steps, self._contacts)
        found = Found(np.full(shape, -1), np.zeros((*shape, 3)))
        seconds = np.zeros((runs, steps))
        for i in range(runs):
            known: tuple[Contact, ...] = ()
            for t in range(steps):
                start = time.perf_counter()
                estimate = self._localizer.locate(
                    q[i],
                    base_wrench=base_wrench[i, t],
                    joint_torque=joint_torque[i, t],
                    detect=False,
                    contacts=t + 1,
                    known=known,
                    drift=self._drift,
                )
                seconds[i, t] = time.perf_counter() - start
                # Without sets, the contacts of an estimate are alternatives to each other.
                known = estimate.contacts if estimate.explanations else estimate.contacts[:1]
                for k, contact in enumerate(known):
                    found.link[i, t, k] = contact.link_index
                    found.point_base[i, t, k] = contact.point_base
        return TrackedAnswers(found, np.median(seconds, axis=0))
