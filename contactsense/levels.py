"""At which energies of "nothing touches" contacts of one scene begin and end."""

import numpy as np

from contactsense.detection import level, release_level, single_level
from contactsense.scene import Scene

SLOWEST = 20
"""From so many milliseconds a sample on, levels do not change any more."""
_SENSORS = 3


def stream_levels(scene: Scene, sizes: tuple[int, ...]) -> np.ndarray:
    """Energies at which a contact of a stream begins and ends.

    Args:
        scene: With the false alarms per hour.
        sizes: How many residuals each sensor has: base sensor, joint torques, wrist sensor.

    Returns:
        Begin and end for each set of sensors, a bit each in that order, and each usual time between samples
        of 1, 2, ... ms; shape (8, SLOWEST, 2).
    """
    table = np.zeros((2**_SENSORS, SLOWEST, 2))
    known: dict[int, np.ndarray] = {}
    for chosen in range(len(table)):
        freedom = _freedom(sizes, tuple(bool(chosen >> i & 1) for i in range(_SENSORS)))
        if freedom not in known:
            begin = [
                level(scene.false_alarms_per_hour, freedom, scene.bandwidth, 1e-3 * (pace + 1))
                for pace in range(SLOWEST)
            ]
            known[freedom] = np.column_stack((begin, np.full(SLOWEST, release_level(freedom))))
        table[chosen] = known[freedom]
    return table


class SingleLevels:
    """Levels of single measurements, worked out once for each set of sensors."""

    def __init__(self, scene: Scene, sizes: tuple[int, ...]) -> None:
        """As for `stream_levels`."""
        self._per_hour, self._bandwidth = scene.false_alarms_per_hour, scene.bandwidth
        self._sizes = sizes
        self._known: dict[tuple[bool, ...], float] = {}

    def level(self, present: tuple[bool, ...]) -> float:
        """Energy that noise exceeds in a single measurement as seldom as told; `present`: which sensors
        count."""
        if present not in self._known:
            freedom = _freedom(self._sizes, present)
            self._known[present] = single_level(self._per_hour, freedom, self._bandwidth)
        return self._known[present]


def _freedom(sizes: tuple[int, ...], present: tuple[bool, ...]) -> int:
    return max(sum(size for size, there in zip(sizes, present, strict=True) if there), 1)
