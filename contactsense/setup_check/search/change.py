"""One accepted change of a setup, which can be made to another setup as well."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from dataclasses import replace as with_values
from typing import Any

import numpy as np

from contactsense.setup_check.lines import Line
from contactsense.setup_check.setup import Free, SensorSetup, Setup


@dataclass(frozen=True)
class Change:
    """What one hypothesis changed."""

    line: Line
    free: tuple[Free, ...]
    """Continuous parameters that it estimated."""
    before: Setup
    after: Setup
    start: Setup
    """As `after`, with the values from which the parameters were estimated."""
    text: str = ""
    """In words, how it may have arisen; may be empty."""

    def on(self, setup: Setup) -> Setup:
        """The same change of another setup: what this one leaves as it is keeps the other's values."""
        changed = _changed(self.before, self.after, ("sensors", "gain"))
        known = self.before.gain != 0.0
        factor = np.divide(self.after.gain, self.before.gain, where=known, out=np.ones(len(known)))
        found = with_values(setup, **changed, gain=setup.gain * factor)
        for field, sensor in self.before.sensors.items():
            own = _sensor(sensor, self.after.sensors[field], found.sensors[field])
            found = found.with_sensor(field, **own)
        return found

    def unfitted(self) -> "Change":
        """The change without what was estimated."""
        return with_values(self, after=self.start)


def with_changes(changes: Iterable[Change], setup: Setup) -> Setup:
    """The setup with all of these changes, in their order."""
    for change in changes:
        setup = change.on(setup)
    return setup


def groups(*parts: tuple[Free, ...]) -> tuple[Free, ...]:
    """All groups of parameters, each once."""
    return tuple(dict.fromkeys(group for part in parts for group in part))


def with_estimates(setup: Setup, free: tuple[Free, ...], fitted: Setup) -> Setup:
    """The setup with the values of `fitted` for the fields that these parameters change."""
    moved = setup.moved(free, np.full(sum(group.size for group in free), 1e-3))
    names = _changed(setup, moved, ("sensors",))
    estimated = with_values(setup, **{name: getattr(fitted, name) for name in names})
    for field, sensor in setup.sensors.items():
        own = _changed(sensor, moved.sensors[field], ())
        values = {name: getattr(fitted.sensors[field], name) for name in own}
        estimated = estimated.with_sensor(field, **values)
    return estimated


def _sensor(before: SensorSetup, after: SensorSetup, now: SensorSetup) -> dict[str, Any]:
    changed = _changed(before, after, ("order",))
    return {**changed, "order": now.order @ np.linalg.solve(before.order, after.order)}


def _changed(before: Any, after: Any, apart: tuple[str, ...]) -> dict[str, Any]:
    """Fields of two dataclasses that differ, with their later values; those in `apart` are left out."""
    names = [field.name for field in fields(before) if field.name not in apart]
    pairs = {name: (getattr(before, name), getattr(after, name)) for name in names}
    return {name: b for name, (a, b) in pairs.items() if not _same(a, b)}


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)
