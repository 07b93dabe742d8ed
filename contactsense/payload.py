"""A weight that has been picked up, told from a push.

A weight pulls along gravity, all joints carry it, it hangs near the flange, and it stays what it is. A push
that does all of that to within the noise is possible, yet seldom: where the sensors are good enough to tell,
a load like that is taken for a weight and becomes a part of the arm, until it is put down.
"""

import numpy as np

from contactsense.scene import Scene
from contactsense.tracker import AGE
from contactsense.workspace import Workspace
from robots import Inertia
from robots.tool import join_inertia

PATIENCE = 0.5
"""A load is looked at once it has been held for so long [s]."""
EVERY = 0.1
"""And again so often [s]."""
SHARP = 0.02
"""Its direction must be known so well, standard deviation [rad]."""
LIKELY = 14.0
"""Square of the distance from a weight, three degrees of freedom: noise exceeds it three times in a
thousand."""
LINK_ENERGY = 8.0
"""Of the last link's explanation of the torques, beyond the best link's."""
REACH = 0.5
"""Weights hang no further from the flange, across gravity [m]."""
SAME = 0.1
"""What is put down is what was picked up, to this share."""
STEADY, LOOKS = 4.0, 4
"""Its force may differ by so many standard deviations from what it was before, for so many looks."""
_IN_BASE = slice(0, 6)
"""Of a window's mean: the base wrench in the frame of the base, which is the first body."""
_LATELY = 2
"""Window whose mean is looked at: of a seventh of a second with an observer of 10 Hz."""


class PickUp:
    """Weights that come and go at the flange of one arm with base sensor and joint torques."""

    def __init__(self, scene: Scene, work: Workspace) -> None:
        """Nothing is carried but the scene's own tool."""
        self._arm, self._memory = work.arm, work.memory
        self._down = scene.gravity_base / scene.gravity
        self._gravity = scene.gravity
        self._flange = scene.robot.flange_translation
        self._across = np.linalg.svd(self._down[None])[2][1:]
        self.reset()

    def reset(self) -> None:
        """Nothing is carried; the model has been put back by whoever calls."""
        self.mass = 0.0
        """What is carried beyond the scene's tool [kg]."""
        self._bare: tuple[float, np.ndarray, np.ndarray] | None = None
        self._looked, self._before, self._steady = 0.0, 0.0, 0

    def step(self) -> float | None:
        """Look at the contact that holds now.

        Returns:
            By how much the weight has changed [kg]; it is in `Memory.model` then. None: it is no weight.
        """
        life = self._memory.track.life
        if life[AGE] < PATIENCE:
            self._looked, self._steady = 0.0, 0
        if life[AGE] < max(PATIENCE, self._looked + EVERY):
            return None
        self._looked = float(life[AGE])
        wrench, covariance = self._load()
        force = float(self._down @ wrench[:3])
        wander = STEADY * np.sqrt(self._down @ covariance[:3, :3] @ self._down)
        self._steady = self._steady + 1 if abs(force - self._before) < wander else 0
        self._before = force
        if self._steady < LOOKS or not self._is_weight(wrench, covariance, force):
            return None
        mass = force / self._gravity
        if mass > 0.0 and self._bare is None:
            self._take(mass, np.cross(self._down, wrench[3:]) / force)
            return mass
        if self._bare is not None and abs(mass + self.mass) < SAME * self.mass:
            self._put_down()
            return mass
        return None

    def _load(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean wrench on the base sensor lately, base axes, and its covariance."""
        track = self._memory.track
        noise = track.gain[_LATELY] * self._arm.sensors.base_covariance
        return track.mean[_LATELY, _IN_BASE].copy(), noise + self._memory.follower.base

    def _is_weight(self, wrench: np.ndarray, covariance: np.ndarray, force: float) -> bool:
        rows = np.zeros((3, 6))
        rows[:2, :3], rows[2, 3:] = self._across, self._down
        off, spread = rows @ wrench, rows @ covariance @ rows.T
        if np.sqrt(max(spread[0, 0], spread[1, 1])) > SHARP * abs(force):
            return False
        if off @ np.linalg.solve(spread, off) > LIKELY:
            return False
        energy = self._memory.hypotheses.energy
        last = len(self._memory.model.mass) - 1
        if energy[last] > energy.min() + LINK_ENERGY:
            return False
        away = np.cross(self._down, wrench[3:]) / force - self._flange_place()
        return bool(np.linalg.norm(away - (away @ self._down) * self._down) < REACH)

    def _flange_place(self) -> np.ndarray:
        motion = self._memory.motion
        return np.asarray(motion.origin[-1] + motion.rotation[-1] @ self._flange)

    def _take(self, mass: float, place: np.ndarray) -> None:
        """Join a weight to the last link; how high it hangs is not known: as high as the flange."""
        model, motion = self._memory.model, self._memory.motion
        self.mass, self._bare = mass, (float(model.mass[-1]), model.com[-1].copy(), model.inertia[-1].copy())
        flange = self._flange_place()
        place = place + self._down * (self._down @ (flange - place))
        com = motion.rotation[-1].T @ (place - motion.origin[-1])
        joined = join_inertia(Inertia(*self._bare), Inertia(mass, com, np.zeros((3, 3))))
        model.mass[-1], model.com[-1], model.inertia[-1] = joined.mass, joined.com, joined.tensor

    def _put_down(self) -> None:
        model = self._memory.model
        assert self._bare is not None
        model.mass[-1], model.com[-1], model.inertia[-1] = self._bare
        self.mass, self._bare = 0.0, None
