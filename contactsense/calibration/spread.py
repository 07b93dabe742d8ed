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


@dataclass(frozen=True)
class Spread:
    """Standard deviations for a scene. n joints."""

    noise: np.ndarray
    """Of one sample [Nm], shape (n,)."""
    model_error: np.ndarray
    """Of what is unexplained in motion [Nm], shape (n,)."""
    rest_error: np.ndarray
    """Of what is unexplained at rest and reversals, beyond that [Nm], shape (n,); NaN where the joint was
    never there."""
    rest_velocity: float
    """Velocity below which `rest_error` counts [rad/s]."""


def spread_of(residual: np.ndarray, qd: np.ndarray, dt: float, gain: float) -> Spread:
    """Noise and model error of the joints.

    Args:
        residual: Of all joints, settled, shape (N, n) [Nm].
        qd: Joint velocities, shape (N, n) [rad/s].
        dt: Sample time [s].
        gain: Variance of the residual over that of white noise in one sample.
    """
    width = max(3, round(_SLOW / dt))
    slow = uniform_filter1d(residual, width, axis=0)
    fast = residual - slow
    noise = np.maximum(1.4826 * np.median(np.abs(fast), axis=0), 1e-6) / np.sqrt(gain)
    best: tuple[float, Spread] | None = None
    for velocity in _REST_VELOCITIES:
        found = _at(residual, slow, qd, noise**2 * gain, velocity)
        spread = Spread(noise, *found, velocity)
        rest = np.nan_to_num(spread.rest_error) ** 2 / (1.0 + (qd / velocity) ** 2) ** 2
        variance = noise**2 * gain + spread.model_error**2 + rest
        score = float(np.mean(residual**2 / variance + np.log(variance)))
        if best is None or score < best[0]:
            best = (score, spread)
    assert best is not None
    return best[1]


def _at(
    residual: np.ndarray, slow: np.ndarray, qd: np.ndarray, noise: np.ndarray, velocity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Model error in motion and at rest, for that limit between the two; `noise`: variance in the
    residual."""
    joints = residual.shape[1]
    model, rest = np.empty(joints), np.full(joints, np.nan)
    for j in range(joints):
        moving = np.abs(qd[:, j]) > 3.0 * velocity
        low = np.abs(qd[:, j]) < velocity
        chosen = moving if moving.sum() >= _FEW else ~low
        if not chosen.any():
            chosen = np.ones(len(qd), dtype=bool)
        model[j] = np.sqrt(max(np.mean(slow[chosen, j] ** 2), _tail(residual[chosen, j]) - noise[j], 0.0))
        if low.any():
            total = max(np.mean(residual[low, j] ** 2), _tail(residual[low, j]))
            # A quarter of the full variance is left at the limit itself, more below: on average about half.
            rest[j] = np.sqrt(2.0 * max(total - noise[j] - model[j] ** 2, 0.0))
    return model, rest


def _tail(values: np.ndarray) -> float:
    """Variance that puts the measured tail where a Gaussian has it; zero for few values."""
    if len(values) < _FEW:
        return 0.0
    return float(np.quantile(np.abs(values), _TAIL) / _TAIL_SIGMA) ** 2
