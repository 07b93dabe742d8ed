"""Noise and model error of the joint torques, estimated from the residuals after calibration.

The fast part of a residual is noise, which a lower bandwidth averages out. The slow part is model error and
does not average out; it is larger at low speed and at reversals, where friction has hysteresis. What a factor
on friction explains of a recording is not model error: a stream estimates that factor. Tails are included:
each standard deviation is at least such that one residual in a thousand exceeds 3.29 of them, as for a
Gaussian.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

_AVERAGING_TIME = 0.5
"""Averages over this time contain only the slow part [s]."""
_TAIL = 0.999
_TAIL_SIGMA = 3.29
_REST_VELOCITIES = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates for the velocity below which friction is uncertain [rad/s]."""
_MIN_TAIL_SAMPLES = 200
"""With fewer samples no tail is evaluated."""
_FRICTION_VARIATION = 0.1
"""Prior for the relative standard deviation of friction between days: the effect of a few degrees on the
viscosity of gear grease."""


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations for a scene. n joints."""

    noise: np.ndarray
    """Of one sample [Nm], shape (n,)."""
    friction_error: np.ndarray
    """Of friction between recordings, relative, shape (n,)."""
    model_error: np.ndarray
    """Of the model in motion, a factor on friction apart [Nm], shape (n,)."""
    rest_error: np.ndarray
    """Of the model at rest and reversals, in addition to `model_error` [Nm], shape (n,); NaN if the joint was
    never at rest."""
    rest_velocity: float
    """Velocity below which `rest_error` applies [rad/s]."""


def estimate_noise(
    residual: list[np.ndarray],
    qd: list[np.ndarray],
    friction: list[np.ndarray],
    dt: float,
    variance_ratio: float,
) -> NoiseLevels:
    """Noise and model error of the joints, from one or more recordings.

    Args:
        residual: Settled residuals of all joints, one array per recording, shape (N, n) [Nm].
        qd: Joint velocities, in the same form [rad/s].
        friction: Values of the friction formula, in the same form [Nm].
        dt: Sample time [s].
        variance_ratio: Variance of the residual over that of white noise in one sample.
    """
    factors = [_factor(r, f) for r, f in zip(residual, friction, strict=True)]
    error = _between_recordings(factors)
    residual = [r - np.nan_to_num(a) * f for r, a, f in zip(residual, factors, friction, strict=True)]
    slow = [uniform_filter1d(part, max(3, round(_AVERAGING_TIME / dt)), axis=0) for part in residual]
    residuals, mean = np.vstack(residual), np.vstack(slow)
    speed = np.abs(np.vstack(qd))
    noise = np.maximum(1.4826 * np.median(np.abs(residuals - mean), axis=0), 1e-6) ** 2

    def levels(velocity: float) -> NoiseLevels:
        model, rest = _model_error(residuals, mean, speed, noise, velocity)
        return NoiseLevels(np.sqrt(noise / variance_ratio), error, model, rest, velocity)

    def cost(found: NoiseLevels) -> float:
        at_rest = np.nan_to_num(found.rest_error) ** 2 / (1.0 + (speed / found.rest_velocity) ** 2) ** 2
        variance = noise + found.model_error**2 + at_rest
        return float(np.mean(residuals**2 / variance + np.log(variance)))

    return min(map(levels, _REST_VELOCITIES), key=cost)


def _factor(residual: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Relative change of friction that explains most of one recording's residual, shape (n,); NaN for a joint
    without friction."""
    square = np.sum(friction**2, axis=0)
    found: np.ndarray = np.sum(residual * friction, axis=0) / np.where(square > 0.0, square, np.nan)
    return found


def _between_recordings(factors: list[np.ndarray]) -> np.ndarray:
    """Relative variation of friction between recordings: root mean square of their `_factor`, combined with
    the prior `_FRICTION_VARIATION`; zero for a joint without friction in any of them."""
    count = np.sum(np.isfinite(factors), axis=0)
    # The fit takes one degree of freedom for the factors' mean; the prior counts as two recordings.
    squares = np.nansum(np.square(factors), axis=0) + 2.0 * _FRICTION_VARIATION**2
    return np.where(count > 0, np.sqrt(squares / (count - 1.0 + 2.0)), 0.0)


def _model_error(
    residual: np.ndarray,
    slow: np.ndarray,
    speed: np.ndarray,
    noise: np.ndarray,
    velocity: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Model error in motion and at rest, with that velocity between the two. `noise`: variance of the
    residual from other sources, shape (n,)."""
    joints = residual.shape[1]
    model, rest = np.empty(joints), np.full(joints, np.nan)
    for j in range(joints):
        moving, low = speed[:, j] > 3.0 * velocity, speed[:, j] < velocity
        used = moving if moving.sum() >= _MIN_TAIL_SAMPLES else ~low
        if not used.any():
            used = np.ones(len(speed), dtype=bool)
        model[j] = np.sqrt(
            max(np.mean(slow[used, j] ** 2), _excess_variance(residual[used, j], float(noise[j])))
        )
        if low.any():
            total = max(
                np.mean(residual[low, j] ** 2) - noise[j],
                _excess_variance(residual[low, j], float(noise[j])),
            )
            # At the limit itself a quarter of the full variance remains: on average about half.
            rest[j] = np.sqrt(2.0 * max(total - model[j] ** 2, 0.0))
    return model, rest


def _excess_variance(values: np.ndarray, known_variance: float) -> float:
    """Variance to be added to the known one for a Gaussian tail; zero for few values."""
    if len(values) < _MIN_TAIL_SAMPLES:
        return 0.0
    low, high = 0.0, float(np.max(values**2))
    for _ in range(40):
        middle = 0.5 * (low + high)
        heavy_tailed = np.mean(np.abs(values) > _TAIL_SIGMA * np.sqrt(known_variance + middle)) > 1.0 - _TAIL
        low, high = (middle, high) if heavy_tailed else (low, middle)
    return high
