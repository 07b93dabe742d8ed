"""At which energies of "nothing touches" contacts of one scene begin and end."""

from contactsense.detection import level, release_level, single_level
from contactsense.scene import Scene

_SLOWEST = 20
"""From so many milliseconds a sample on, levels do not change any more."""


class Levels:
    """Levels for the false alarms per hour of a scene, worked out once for each set of sensors and pace."""

    def __init__(self, scene: Scene, sizes: tuple[int, ...]) -> None:
        """`sizes`: how many residuals each sensor has."""
        self._per_hour, self._bandwidth = scene.false_alarms_per_hour, scene.bandwidth
        self._sizes = sizes
        self._known: dict[tuple[tuple[bool, ...], int], tuple[float, float]] = {}
        self._single: dict[tuple[bool, ...], float] = {}

    def _freedom(self, present: tuple[bool, ...]) -> int:
        return max(sum(size for size, there in zip(self._sizes, present, strict=True) if there), 1)

    def single(self, present: tuple[bool, ...]) -> float:
        """Energy that noise exceeds in a single measurement as seldom as told; `present`: which sensors
        count."""
        if present not in self._single:
            self._single[present] = single_level(self._per_hour, self._freedom(present), self._bandwidth)
        return self._single[present]

    def stream(self, present: tuple[bool, ...], step: float) -> tuple[float, float]:
        """Energies at which a contact of a stream begins and ends; `step`: usual time between samples [s]."""
        pace = min(max(round(1e3 * step), 1), _SLOWEST)
        if (present, pace) not in self._known:
            freedom = self._freedom(present)
            self._known[present, pace] = (
                level(self._per_hour, freedom, self._bandwidth, 1e-3 * pace),
                release_level(freedom),
            )
        return self._known[present, pace]
