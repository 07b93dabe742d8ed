"""Which changes of a setup matter."""

import numpy as np

from contactsense.setup_check.fit.fitter import Fit
from contactsense.setup_check.setup import SCALED, Free, Kind, Setup

_TOLERANCE: dict[Kind, float] = {
    "zero": np.radians(2.0),
    "tilt": np.radians(1.0),
    "mass": 0.15,
    "com": 0.02,
    "load": 0.3,
    "place": 0.1,
    "turn": np.radians(2.0),
    "shift": 0.01,
    "delay": 0.003,
    "lag": 0.02,
    "force": 0.1,
    "moment": 0.1,
    "wrench": 0.1,
    "gain": 0.1,
}
"""Changes below this do not matter [rad, m, s, kg, logarithm]; larger standard deviations determine
nothing."""


def matters(before: Setup, fit: Fit) -> bool:
    """Whether a fit changes the setup by more than the tolerances; a discrete change always matters."""
    return not fit.free or any(
        _change(name, before, fit.setup) > tolerance(name, fit.setup) for name in fit.free
    )


def tolerance(group: Free, setup: Setup) -> float:
    """Largest change that does not matter, in the unit of `_change`; a larger standard deviation determines
    nothing."""
    # The centre of mass of a light tool matters less.
    light = min(1.0, max(setup.mass, 0.01)) if group.kind == "com" else 1.0
    return _TOLERANCE[group.kind] / light


def _change(group: Free, a: Setup, b: Setup) -> float:
    """Size of the change of a parameter [rad, kg, m, s; of a scale its logarithm]."""
    if group.kind == "zero":
        return float(np.abs(np.subtract(b.angle_zero, a.angle_zero)).max())
    if group.kind == "tilt":
        both = np.linalg.norm(a.gravity) * np.linalg.norm(b.gravity)
        return float(np.arccos(np.clip(a.gravity @ b.gravity / both, -1.0, 1.0)))
    if group.kind == "mass":
        return abs(a.mass - b.mass)
    if group.kind == "com":
        return float(np.linalg.norm(a.com - b.com))
    if group.kind == "load":
        return float(np.abs(a.loads - b.loads).max())
    if group.kind == "place":
        # Where nothing was, no place has changed.
        return float(np.linalg.norm((a.places - b.places)[a.loads > 0.0]))
    if group.kind == "gain":
        known = a.gain != 0.0
        return float(np.abs(np.log(np.abs(b.gain[known] / a.gain[known]))).max())
    if group.kind == "lag":
        return abs(a.torque_delay - b.torque_delay)
    one, other = a.sensors[group.field], b.sensors[group.field]
    if group.kind == "turn":
        return float(np.arccos(np.clip((np.trace(one.rotation.T @ other.rotation) - 1.0) / 2.0, -1.0, 1.0)))
    if group.kind in SCALED:
        sizes = np.abs(one.order).sum(axis=0), np.abs(other.order).sum(axis=0)
        return float(np.abs(np.log(sizes[1] / sizes[0])).max())
    if group.kind == "shift":
        return float(np.linalg.norm(one.translation - other.translation))
    return abs(one.delay - other.delay)
