"""Noise, and what the model leaves unexplained: from the residuals that remain after calibration.

The fast part of a residual is noise, which a lower bandwidth averages out. The slow part is the model's
error and does not average out; at low speed and at reversals, where friction is hysteresis rather than a
formula, it is larger. Tails count: each level is at least what puts one residual in a thousand beyond 3.29
standard deviations, as it would be for a Gaussian.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

_SLOW = 0.5
"""Averages over so long a time hold the slow part [s]."""
_TAIL = 0.999
_TAIL_SIGMA = 3.29
_REST_VELOCITIES = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates for the velocity below which friction is uncertain [rad/s]."""
_FEW = 200
"""From fewer samples no tail is taken."""
_OTHER_DAY = 0.1
"""Friction on another day, relative standard deviation, as long as no recordings say otherwise: what the
viscosity of a gear's grease does over a few degrees."""


@dataclass(frozen=True)
class Spread:
    """Standard deviations for a scene. n joints."""

    noise: np.ndarray
    """Of one sample [Nm], shape (n,)."""
    friction_error: np.ndarray
    """Of friction from one recording to another, relative, shape (n,)."""
    model_error: np.ndarray
    """Of what is unexplained in motion beyond that [Nm], shape (n,)."""
    rest_error: np.ndarray
    """Of what is unexplained at rest and reversals, beyond that [Nm], shape (n,); NaN where the joint was
    never there."""
    rest_velocity: float
    """Velocity below which `rest_error` counts [rad/s]."""


def spread_of(
    residual: list[np.ndarray], qd: list[np.ndarray], friction: list[np.ndarray], dt: float, gain: float
) -> Spread:
    """Noise and model error of the joints, from one or more recordings.

    Args:
        residual: Of all joints, settled, one recording each, shape (N, n) [Nm].
        qd: Joint velocities, alike [rad/s].
        friction: What the friction formula says, alike [Nm].
        dt: Sample time [s].
        gain: Variance of the residual over that of white noise in one sample.
    """
    slow = [uniform_filter1d(part, max(3, round(_SLOW / dt)), axis=0) for part in residual]
    error = _between_recordings(residual, friction)
    all_, mean = np.vstack(residual), np.vstack(slow)
    speed = np.abs(np.vstack(qd))
    noise = np.maximum(1.4826 * np.median(np.abs(all_ - mean), axis=0), 1e-6) ** 2
    known = noise + (error * np.vstack(friction)) ** 2
    best: tuple[float, Spread] | None = None
    for velocity in _REST_VELOCITIES:
        model, rest = _levels(all_, mean, speed, known, known - noise, velocity)
        found = Spread(np.sqrt(noise / gain), error, model, rest, velocity)
        variance = known + model**2 + np.nan_to_num(rest) ** 2 / (1.0 + (speed / velocity) ** 2) ** 2
        score = float(np.mean(all_**2 / variance + np.log(variance)))
        if best is None or score < best[0]:
            best = (score, found)
    assert best is not None
    return best[1]


def _between_recordings(residual: list[np.ndarray], friction: list[np.ndarray]) -> np.ndarray:
    """By how much friction differs from one recording to another, relative: root mean square of the factors
    that explain most of each recording's residual. One recording tells nothing of that: see `_OTHER_DAY`."""
    factors = [
        np.sum(r * f, axis=0) / np.maximum(np.sum(f**2, axis=0), 1e-12)
        for r, f in zip(residual, friction, strict=True)
        if np.sum(f**2) > 0.0
    ]
    if not factors:
        return np.zeros(residual[0].shape[1])
    # The fit has spent one freedom on the factors' mean; the prior is worth as much as two recordings.
    squares = np.sum(np.square(factors), axis=0) + 2.0 * _OTHER_DAY**2
    return np.asarray(np.sqrt(squares / (len(factors) - 1.0 + 2.0)))


def _levels(
    residual: np.ndarray,
    slow: np.ndarray,
    speed: np.ndarray,
    known: np.ndarray,
    slow_known: np.ndarray,
    velocity: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Model error in motion and at rest, for that limit between the two; `known` and `slow_known`: variance
    of the residual and of its slow part that has other reasons, shape (N, n)."""
    joints = residual.shape[1]
    model, rest = np.empty(joints), np.full(joints, np.nan)
    for j in range(joints):
        moving, low = speed[:, j] > 3.0 * velocity, speed[:, j] < velocity
        chosen = moving if moving.sum() >= _FEW else ~low
        if not chosen.any():
            chosen = np.ones(len(speed), dtype=bool)
        usual = np.mean(slow[chosen, j] ** 2) - np.mean(slow_known[chosen, j])
        model[j] = np.sqrt(max(usual, _beyond(residual[chosen, j], known[chosen, j]), 0.0))
        if low.any():
            total = max(
                np.mean(residual[low, j] ** 2) - np.mean(known[low, j]),
                _beyond(residual[low, j], known[low, j]),
            )
            # At the limit itself a quarter of the full variance is left: on average about half.
            rest[j] = np.sqrt(2.0 * max(total - model[j] ** 2, 0.0))
    return model, rest


def _beyond(values: np.ndarray, known: np.ndarray) -> float:
    """Variance that must come to the known one for the tail to be a Gaussian's; zero for few values."""
    if len(values) < _FEW:
        return 0.0
    low, high = 0.0, float(np.max(values**2))
    for _ in range(40):
        middle = 0.5 * (low + high)
        heavy = np.mean(np.abs(values) > _TAIL_SIGMA * np.sqrt(known + middle)) > 1.0 - _TAIL
        low, high = (middle, high) if heavy else (low, middle)
    return high
