"""What a perfect search could find: the search for several contacts, started at the truth as well."""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from contactsense import Contact, Estimate, Scene
from contactsense.answer import Composer
from contactsense.arm import build_arm
from contactsense.candidates import MOST
from contactsense.energy import lean_in
from contactsense.entry import once
from contactsense.memory import empty_memory
from contactsense.report import WIDTH
from contactsense.several.explain import take_known, weigh_known, weigh_set
from contactsense.several.locator import SetLocator
from contactsense.several.memory import Bodies, Several
from contactsense.several.stack import put
from contactsense.skin import skin_of
from contactsense.unfold import unfold
from contactsense.workspace import Workspace
from robots.compiled import kernel
from robots.surface import project

LONG = 10
"""How many times the search from the truth is taken up again where it stopped: it shall not count as an end
where it had no more steps."""
ON = 0.003
"""Nearer to a primitive's surface than this, a place may be on it: the search weighs all that it may be on
[m]."""
ENOUGH = 0.01
"""Gain in log evidence that is worth taking it up again."""


class Ended(NamedTuple):
    """Where the search ends that starts at the truth."""

    gain: float
    """Log evidence over that of the best explanation that was found without knowing the truth."""
    point_base: np.ndarray
    """Places, in the order of the true ones, shape (K, 3) [m]."""


class Oracle:
    """Explains a sample of an arm at rest by several contacts, as `Localizer.locate` does, and from the
    truth."""

    def __init__(self, scene: Scene) -> None:
        """Of a scene with base sensor and joint torques."""
        arm = build_arm(scene)
        self._work = Workspace(arm, empty_memory(arm))
        skin = skin_of(scene)
        self._buffers = (self._work.floats, self._work.integers, self._work.sizes, skin)
        self._parts = (*self._buffers[:3], *skin)
        self._composer = Composer(scene, arm.surfaces.start)
        self._sets = SetLocator(scene, self._work, self._buffers, self._composer)
        self._rows = np.zeros((max(len(arm.surfaces.kind), MOST), WIDTH))

    def locate(
        self,
        q: np.ndarray,
        base_wrench: np.ndarray,
        joint_torque: np.ndarray,
        contacts: int,
        known: Sequence[Contact],
        drift: float | None,
    ) -> Estimate:
        """The estimate of `Localizer.locate`; arguments as there."""
        present = (True, True, False)
        listed, _ = once(
            *self._parts,
            q,
            joint_torque,
            base_wrench,
            np.zeros(6),
            True,
            *present,
            False,
            -1.0,
            self._rows,
        )
        if contacts > 1:
            return self._sets.explain(present, contacts, known, drift)
        return self._composer.contacts(0.0, self._work.memory, self._rows, listed)

    def from_truth(self, links: np.ndarray, points: np.ndarray, forces: np.ndarray, known: int) -> Ended:
        """Search from the true contacts, after `locate` of the same sample.

        Args:
            links: Numbers of the touched links, shape (K,); those that were known first, in their order.
            points, forces: Base frame, shapes (K, 3) [m, N].
            known: How many were known. They start where they were found.
        """
        arm, several = self._work.arm, self._sets.several
        m, best = 6 + arm.model.joints, Ended(-np.inf, points)
        found = self._sets.found
        reference = found.score[found.order[0]]
        sides = [self._primitives(link, point) for link, point in zip(links, points, strict=True)]
        for primitives in product(*sides):
            score = _from(*self._buffers[:3], several, m, known, np.array(primitives), points, forces)
            if score - reference > best.gain:
                best = Ended(score - reference, several.stack.point[: len(links)].copy())
        return best

    def _primitives(self, link: int, point: np.ndarray) -> list[int]:
        """Primitives of a link on whose surface a place is, about."""
        surfaces, motion = self._work.arm.surfaces, self._work.memory.motion
        body = self._work.arm.sensors.depth[link]
        local = (point - motion.origin[body]) @ motion.rotation[body]
        own = range(surfaces.start[link], surfaces.start[link + 1])
        away = [
            abs(project(surfaces.kind[p], surfaces.size[p], *at)[0])
            for p in own
            for at in [surfaces.rotation[p].T @ (local - surfaces.origin[p])]
        ]
        return [p for p, gap in zip(own, away, strict=True) if gap < max(ON, min(away) + 1e-9)]


@kernel
def _from(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int],
    several: Several,
    m: int,
    known: int,
    primitive: np.ndarray,
    point: np.ndarray,
    force: np.ndarray,
) -> float:
    """Log evidence of the contacts that the search ends at; they stay in `several.stack`."""
    arm, memory = unfold(floats, integers, sizes)
    surfaces, stack, scan = arm.surfaces, several.stack, several.scan
    bodies = Bodies(memory.found.rotation, memory.found.origin)
    count = primitive.shape[0]
    for i in range(known):
        take_known(surfaces, bodies, several.known, stack, scan.normals[i], 1.0, i)
    whole = weigh_known(surfaces, arm.prior, bodies, several.rows, known, stack)
    for i in range(count):
        c, f, T = point[i], force[i], stack.frame[i]
        if i < known:
            take_known(surfaces, bodies, several.known, stack, scan.normals[i], 1.0, i)
        else:
            put(surfaces, bodies, stack, i, primitive[i], c[0], c[1], c[2], 0.0, 0.0, 0.0)
            stack.prior_sharpness[i] = 0.0
            stack.prior_stiffness[i] = 0.0
        fx, fy, fz = lean_in(f[0], f[1], f[2], T[0, 0], T[1, 0], T[2, 0])
        stack.force[i, 0], stack.force[i, 1], stack.force[i, 2] = fx, fy, fz
    best: float = -math.inf
    for _ in range(LONG):
        _, score = weigh_set(surfaces, arm.prior, bodies, several.rows, m, known, count, math.inf, stack)
        if score <= best + ENOUGH:
            break
        best = score
    gained: float = best - whole
    return gained
