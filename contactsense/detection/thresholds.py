"""Onset and release thresholds of one scene, for the energy of the no-contact hypothesis."""

import numpy as np

from contactsense.detection.false_alarm_rate import onset_threshold, release_threshold, sample_threshold
from contactsense.robots.jit.kernel import kernel
from contactsense.scene import Scene

LONGEST_STEP_MS = 20
"""For longer sample times the thresholds are those of this one [ms]."""
_SENSORS = 3


def stream_thresholds(scene: Scene, sizes: tuple[int, ...]) -> np.ndarray:
    """Onset and release thresholds for a stream.

    Args:
        scene: With the false alarms per hour.
        sizes: Number of residuals of each sensor: base sensor, joint torques, wrist sensor.

    Returns:
        Onset and release threshold for each set of sensors, one bit each in that order, and each usual sample
        time of 1, 2, ... ms; shape (8, LONGEST_STEP_MS, 2).
    """
    thresholds = np.zeros((2**_SENSORS, LONGEST_STEP_MS, 2))
    cached: dict[int, np.ndarray] = {}
    for sensor_set in range(len(thresholds)):
        degrees_of_freedom = _degrees_of_freedom(
            sizes, tuple(bool(sensor_set >> i & 1) for i in range(_SENSORS))
        )
        if degrees_of_freedom not in cached:
            onset = [
                onset_threshold(
                    scene.false_alarms_per_hour, degrees_of_freedom, scene.bandwidth, 1e-3 * (step + 1)
                )
                for step in range(LONGEST_STEP_MS)
            ]
            cached[degrees_of_freedom] = np.column_stack(
                (onset, np.full(LONGEST_STEP_MS, release_threshold(degrees_of_freedom)))
            )
        thresholds[sensor_set] = cached[degrees_of_freedom]
    return thresholds


class SampleThresholds:
    """Thresholds of single measurements, computed once for each set of sensors."""

    def __init__(self, scene: Scene, sizes: tuple[int, ...]) -> None:
        """Arguments as for `stream_thresholds`."""
        self._per_hour, self._bandwidth = scene.false_alarms_per_hour, scene.bandwidth
        self._sizes = sizes
        self._cached: dict[tuple[bool, ...], float] = {}

    def threshold(self, usable: tuple[bool, ...]) -> float:
        """Energy that noise exceeds at the scene's false-alarm rate; `usable`: which sensors are used."""
        if usable not in self._cached:
            degrees_of_freedom = _degrees_of_freedom(self._sizes, usable)
            self._cached[usable] = sample_threshold(self._per_hour, degrees_of_freedom, self._bandwidth)
        return self._cached[usable]


def _degrees_of_freedom(sizes: tuple[int, ...], usable: tuple[bool, ...]) -> int:
    return max(sum(size for size, used in zip(sizes, usable, strict=True) if used), 1)


@kernel
def threshold_index(usual_step: float) -> int:
    """Index of a stream's usual sample time [s] in the table of `stream_thresholds`."""
    return int(min(max(round(1e3 * usual_step), 1), LONGEST_STEP_MS)) - 1
