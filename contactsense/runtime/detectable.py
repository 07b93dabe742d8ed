"""The force that the usable sensors detect wherever it acts: `Estimate.detectable`."""

import math

import numpy as np

from contactsense.detection.detectable_force import detectable_force, detected_length
from contactsense.detection.thresholds import SampleThresholds, threshold_index
from contactsense.runtime.constants import Constants
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import BASE, SCALE, USUAL_STEP

_INTERVAL = 64
"""Number of samples for which the value of a stream is kept: biases and noise change slowly."""
Usable = tuple[bool, bool, bool]
"""Which of base wrench, joint torques and wrist wrench are used."""


class DetectableForce:
    """Detectable forces of one scene, for its stream and for single measurements."""

    def __init__(
        self, constants: Constants, state: State, sizes: tuple[int, int, int], thresholds: SampleThresholds
    ) -> None:
        """Prepare for a scene.

        Args:
            constants, state: The scene's constants and the state of its stream.
            sizes: Number of residuals of each sensor.
            thresholds: Of single measurements.
        """
        self._constants, self._state = constants, state
        self._sizes, self._thresholds = sizes, thresholds
        touchable = constants.touchable.astype(bool)
        self._only_beyond_wrist = bool(constants.sensors.beyond_wrist[touchable].all())
        self._lengths: dict[tuple[int, int], float] = {}
        self._measured: dict[Usable, float] = {}
        self.reset()

    def reset(self) -> None:
        """A new stream begins."""
        self._value, self._left, self._usable = math.inf, 0, (False, False, False)

    def in_stream(self) -> float:
        """Of the newest sample of the stream [N]; infinite where no force is sure to be detected. The value
        is up to 64 samples old."""
        if self._left > 0:
            self._left -= 1
            return self._value
        self._left = _INTERVAL
        return self._update()

    def after_change(self, usable: Usable) -> float:
        """The same where a sensor may have failed since: never older than the set of `usable` sensors."""
        if usable != self._usable:
            self._left = _INTERVAL
            return self._update()
        return self.in_stream()

    def of_measurement(self, usable: Usable) -> float:
        """Of a single measurement at rest [N]."""
        if usable not in self._measured:
            degrees = sum(size for size, used in zip(self._sizes, usable, strict=True) if used)
            length = detected_length(self._thresholds.threshold(usable), degrees)
            noise = self._constants.sensors.base_covariance[:3, :3]
            self._measured[usable] = self._force(usable, length, noise, 1.0)
        return self._measured[usable]

    def _update(self) -> float:
        stream, sensors = self._state.stream, self._constants.sensors
        base, torque, wrist = (stream.usable[:3] > 0.0).tolist()
        self._usable = (base, torque, wrist)
        key = (base + 2 * torque + 4 * wrist, threshold_index(stream.scalars[USUAL_STEP]))
        if key not in self._lengths:
            degrees = sum(size for size, used in zip(self._sizes, self._usable, strict=True) if used)
            threshold = float(self._constants.thresholds[*key, 0])
            self._lengths[key] = detected_length(threshold, max(degrees, 1))
        ratio = float(stream.scalars[SCALE])
        noise = ratio * self._state.noise_scale.scale[BASE] * sensors.base_covariance[:3, :3]
        biases = self._state.bias_filter.base_covariance[:3, :3]
        self._value = self._force(self._usable, self._lengths[key], noise + biases, ratio)
        return self._value

    def _force(self, usable: Usable, length: float, base_covariance: np.ndarray, ratio: float) -> float:
        if usable[0]:
            return detectable_force(length, base_covariance)
        if usable[2] and self._only_beyond_wrist:
            return length * math.sqrt(float(self._constants.sensors.wrist_variance[0]) * ratio)
        return math.inf
