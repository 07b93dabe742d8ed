"""The force that the usable sensors detect wherever it acts: `Estimate.detectable`."""

import math

import numpy as np

from contactsense.detection.detectable_force import detectable_force, detected_length
from contactsense.detection.thresholds import (
    SampleThresholds,
    degrees_of_freedom_of,
    sensor_set,
    threshold_index,
)
from contactsense.robots.jit.declaration import numbers
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from contactsense.sensors.usable_sensors import (
    Usable,
    usable_residuals_code_in_python,
    usable_sensors_in_python,
)

_INTERVAL = 64
"""Number of samples for which the value of a stream is kept: biases and noise change slowly."""


class DetectableForce:
    """Detectable forces of one scene, for its stream and for single measurements."""

    def __init__(self, constants: Constants, state: State, thresholds: SampleThresholds) -> None:
        """Prepare for a scene.

        Args:
            constants, state: The scene's constants and the state of its stream.
            thresholds: Of single measurements.
        """
        self._constants, self._state = constants, state
        self._usual_step = numbers(state.stream.clock, "usual_step")
        self._variance_ratio = numbers(state.stream.clock, "variance_ratio")
        self._thresholds = thresholds
        # Link sensors that see every link that can be touched.
        first = int(constants.touchable.argmax())
        self._seeing = (constants.sensors.first_link <= first).tolist()
        self._lengths: dict[tuple[int, int], float] = {}
        self._measured: dict[tuple[Usable, bool], float] = {}
        self.reset()

    def reset(self) -> None:
        """A new stream begins."""
        self.value, self.left = math.inf, 0
        """The value [N], and for how many samples more `in_stream` keeps it."""
        self._sensors, self._kept = -1, 0

    def in_stream(self) -> float:
        """Of the newest sample of the stream, which all sensors of the scene have measured [N]; infinite
        where no force is sure to be detected. The value is up to 64 samples old."""
        if self.left > 0:
            self.left -= 1
            return self.value
        self.left = _INTERVAL
        return self._update()

    def after_change(self, sensors: int) -> float:
        """The same where a sensor may have failed since: never older than the set of usable sensors, of which
        `sensors` is the code, see `usable_residuals_code_in_python`."""
        if self._kept > 0 and sensors == self._sensors:
            self._kept -= 1
            return self.value
        # Which sensors the next sample has is not known to `in_stream`.
        self._kept, self.left = _INTERVAL, 0
        return self._update()

    def of_measurement(self, usable: Usable, external: bool) -> float:
        """Of a single measurement at rest [N]; without `external`, the weight of the arm's model is
        subtracted from it, with the error of that."""
        if (usable, external) not in self._measured:
            degrees = degrees_of_freedom_of(self._constants.model.joints, usable)
            length = detected_length(self._thresholds.threshold(usable), degrees)
            sensors = self._constants.sensors
            base = sensors.base_covariance[:3, :3] + self._weight_covariance(0, external)
            mounted = self._constants.link_sensors
            pairs = zip(mounted.first_body.tolist(), mounted.mass.tolist(), strict=True)
            model = np.array([self._weight_covariance(k, external, m) for k, m in pairs]).reshape(-1, 3, 3)
            links = sensors.link_variance[:, 0, None, None] * np.eye(3) + model
            self._measured[usable, external] = self._force(usable, length, base, links)
        return self._measured[usable, external]

    def _weight_covariance(self, first: int, external: bool, load: float = 0.0) -> np.ndarray:
        """Covariance of the weight of links `first` and beyond, and of a load [kg], because of their masses'
        errors, shape (3, 3) [N^2]; it is the same in all postures."""
        error = 0.0 if external else self._constants.inertia_error
        masses = np.append(self._constants.model.mass[first:], load)
        weight = error * np.outer(masses, self._constants.gravity)
        return np.asarray(weight.T @ weight)

    def _update(self) -> float:
        state, stream = self._state, self._state.stream
        self._sensors, usable = usable_residuals_code_in_python(stream), usable_sensors_in_python(stream)
        key = (sensor_set(*usable), threshold_index(self._usual_step[0]))
        if key not in self._lengths:
            degrees = degrees_of_freedom_of(self._constants.model.joints, usable)
            threshold = float(self._constants.thresholds[*key, 0])
            self._lengths[key] = detected_length(threshold, degrees)
        ratio = float(self._variance_ratio[0])
        covariance = ratio * state.base_noise[:3, :3] + state.bias_filter.base_covariance[:3, :3]
        error = state.link_velocity_error
        model = (error.noise + error.instants + state.link_mass_covariance)[:, :3, :3]
        links = ratio * self._constants.sensors.link_variance[:, 0, None, None] * np.eye(3) + model
        self.value = self._force(usable, self._lengths[key], covariance, links)
        return self.value

    def _force(
        self, usable: Usable, length: float, base_covariance: np.ndarray, link_covariances: np.ndarray
    ) -> float:
        if usable[0]:
            return detectable_force(length, base_covariance)
        seeing = (
            detectable_force(length, covariance)
            for s, covariance in enumerate(link_covariances)
            if usable[2] >> s & 1 and self._seeing[s]
        )
        return min(seeing, default=math.inf)
