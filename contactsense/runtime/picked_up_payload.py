"""Recognize a payload that the arm has picked up, as opposed to a contact.

A payload pulls along gravity, loads all joints, hangs near the flange and keeps its weight. A push can do the
same to within the noise, but rarely does. If the sensors are precise enough, such a load is treated as a
payload and added to the arm's model until it is put down.
"""

import numpy as np

from contactsense.residuals.bias_filter import masses
from contactsense.residuals.payload_error import add_payload_errors, remove_payload_errors
from contactsense.robots import Inertia
from contactsense.robots.tool import join_inertia
from contactsense.runtime.buffers import KernelBuffers
from contactsense.scene import Scene

MIN_DURATION = 0.5
"""A load is tested once the contact has lasted this long [s]."""
CHECK_INTERVAL = 0.1
"""Time between two tests [s]."""
MAX_DIRECTION_STD = 0.02
"""Largest standard deviation of the force direction for a test [rad]."""
MAX_SQUARED_DISTANCE = 14.0
"""Largest squared Mahalanobis distance from a pure weight, three degrees of freedom: noise exceeds it with
probability 0.003."""
MAX_ENERGY_EXCESS = 8.0
"""Largest energy of the last link's hypothesis above that of the best link."""
MAX_FLANGE_DISTANCE = 0.5
"""Largest horizontal distance of the payload from the flange [m]."""
MASS_TOLERANCE = 0.1
"""Relative tolerance between the mass put down and the mass picked up."""
MAX_FORCE_CHANGE, STEADY_CHECKS = 4.0, 4
"""The force may change by at most `MAX_FORCE_CHANGE` standard deviations between tests, for `STEADY_CHECKS`
tests in a row."""
_BASE_WRENCH = slice(0, 6)
"""Columns of a window mean: the base wrench in the frame of the base, which is the first body."""
_WINDOW = 2
"""Index of the window whose mean is tested: 0.14 s long at a bandwidth of 10 Hz."""


class PickedUpPayload:
    """Payloads picked up and put down at the flange of one arm with base sensor and joint torques."""

    def __init__(self, scene: Scene, buffers: KernelBuffers) -> None:
        """Start with the scene's own tool only."""
        self._state = buffers.state
        self._down = scene.gravity_base / scene.gravity
        self._gravity = scene.gravity
        self._flange = scene.robot.flange_translation
        self._estimates_masses = scene.inertia_error > 0.0
        joints = len(scene.robot.joints)
        self._last_mass = masses(joints) + joints - 1
        self._horizontal = np.linalg.svd(self._down[None])[2][1:]
        self.reset()

    def reset(self) -> None:
        """Start without a payload; the caller restores model and filter."""
        self.mass = 0.0
        """Mass of the payload, without the scene's tool [kg]."""
        self._unloaded: Inertia | None = None
        self._unloaded_variance = 0.0
        self._begin_contact(0)

    def _begin_contact(self, number: int) -> None:
        """Start without a test of the contact with that number."""
        self._contact, self._last_check, self._last_force, self._steady_checks = number, 0.0, 0.0, 0

    def step(self) -> float | None:
        """Test the current contact, which keeps its position.

        Returns:
            Change of the payload's mass [kg]; `State.model` includes it already. None: not a payload.
        """
        status = self._state.track.status[0]
        number, age = int(status.number), status.age
        # One that is resumed keeps its number, but is as young as another.
        if number != self._contact or age < self._last_check:
            self._begin_contact(number)
        if age < max(MIN_DURATION, self._last_check + CHECK_INTERVAL):
            return None
        self._last_check = age
        wrench, noise = self._mean_wrench()
        covariance = noise + self._state.bias_filter.base_covariance
        force = float(self._down @ wrench[:3])
        tolerance = MAX_FORCE_CHANGE * np.sqrt(self._down @ covariance[:3, :3] @ self._down)
        self._steady_checks = self._steady_checks + 1 if abs(force - self._last_force) < tolerance else 0
        self._last_force = force
        if self._steady_checks < STEADY_CHECKS or not self._is_payload(wrench, covariance, force):
            return None
        mass = force / self._gravity
        if mass > 0.0 and self._unloaded is None:
            self._pick_up(mass, np.cross(self._down, wrench[3:]) / force, noise)
            return mass
        if self._unloaded is not None and abs(mass + self.mass) < MASS_TOLERANCE * self.mass:
            self._put_down()
            return mass
        return None

    def _mean_wrench(self) -> tuple[np.ndarray, np.ndarray]:
        """Recent mean wrench on the base sensor, base axes, and the covariance of its noise."""
        track = self._state.track
        noise = track.windows[_WINDOW].variance_ratio * self._state.base_noise
        return track.mean[_WINDOW, _BASE_WRENCH].copy(), noise

    def _is_payload(self, wrench: np.ndarray, covariance: np.ndarray, force: float) -> bool:
        rows = np.zeros((3, 6))
        rows[:2, :3], rows[2, 3:] = self._horizontal, self._down
        deviation, deviation_covariance = rows @ wrench, rows @ covariance @ rows.T
        if np.sqrt(max(deviation_covariance[0, 0], deviation_covariance[1, 1])) > MAX_DIRECTION_STD * abs(
            force
        ):
            return False
        if deviation @ np.linalg.solve(deviation_covariance, deviation) > MAX_SQUARED_DISTANCE:
            return False
        energy = self._state.hypotheses.energy
        last = len(self._state.model.mass) - 1
        if energy[last] > energy.min() + MAX_ENERGY_EXCESS:
            return False
        offset = np.cross(self._down, wrench[3:]) / force - self._flange_position()
        return bool(np.linalg.norm(offset - (offset @ self._down) * self._down) < MAX_FLANGE_DISTANCE)

    def _flange_position(self) -> np.ndarray:
        motion = self._state.motion
        return np.asarray(motion.origin[-1] + motion.rotation[-1] @ self._flange)

    def _pick_up(self, mass: float, point: np.ndarray, noise: np.ndarray) -> None:
        """Join the payload to the last link, at the height of the flange; the filter of the biases finds the
        true one when the link tilts."""
        model, motion, bias_filter = self._state.model, self._state.motion, self._state.bias_filter
        rotation, origin = motion.rotation[-1], motion.origin[-1]
        bare = Inertia(float(model.mass[-1]), model.com[-1].copy(), model.inertia[-1].copy())
        point = point + self._down * (self._down @ (self._flange_position() - point))
        payload = Inertia(mass, rotation.T @ (point - origin), np.zeros((3, 3)))
        self.mass, self._unloaded = mass, bare
        self._unloaded_variance = float(bias_filter.covariance[self._last_mass, self._last_mass])
        add_payload_errors(bias_filter, bare, payload, rotation, origin, self._gravity * self._down, noise)
        self._set_last_link(join_inertia(bare, payload))

    def _put_down(self) -> None:
        """Restore the last link."""
        assert self._unloaded is not None
        remove_payload_errors(self._state.bias_filter, self._unloaded_variance, self._estimates_masses)
        self._set_last_link(self._unloaded)
        self.mass, self._unloaded = 0.0, None

    def _set_last_link(self, inertia: Inertia) -> None:
        model = self._state.model
        model.mass[-1], model.com[-1], model.inertia[-1] = inertia.mass, inertia.com, inertia.tensor
