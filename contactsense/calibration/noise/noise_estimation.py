"""Noise and model error of the joint torques, estimated from the residuals after calibration.

The fast part of a residual is noise, which a lower bandwidth averages out. The slow part is model error and
does not average out; it grows with the inertia torque, and is larger at low speed and at reversals, where
friction has hysteresis. What a factor on friction explains of a recording is not model error: a stream
estimates that factor. Nor is what a stream states for the instants of its samples. Tails are included: each
standard deviation is at least such that one residual in a thousand exceeds 3.29 of them, as for a Gaussian.
Of the errors for which this holds, those in proportion to the inertia torque and those that are not, the most
likely pair is taken. How much less the average of the residuals contains of all of them is estimated in the
same way (`contactsense.residuals.residual_ewma`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from contactsense.calibration.fit.robust_least_squares import MAD_SCALE
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.residuals.residual_ewma import RELATIVE_BANDWIDTH

_AVERAGING_TIME = 0.5
"""Averages over this time contain only the slow part [s]."""
_TAIL, _TAIL_SIGMA = 0.999, 3.29
"""Of a Gaussian variable, this share is within this number of standard deviations."""
_REST_VELOCITIES = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates for the velocity below which friction is uncertain [rad/s]."""
_INERTIA_TORQUE_ERRORS = (0.0, *(float(e) for e in np.round(np.geomspace(0.01, 0.3, 18), 4)))
"""Candidates for the relative error of the inertia torque. A larger one would be a wrong model rather than an
uncertain one."""
_LEAST_VARIANCE = 1e-12
"""A model whose error has a smaller variance counts as perfect [Nm^2]."""
_MIN_TAIL_SAMPLES = 200
"""With fewer samples no tail is evaluated."""
_FRICTION_VARIATION = 0.1
"""Prior for the relative standard deviation of friction between days: the effect of a few degrees on the
viscosity of gear grease."""


class JointResiduals(NamedTuple):
    """Residuals of the n joints in one recording, N samples, and what a stream knows of them. Arrays of shape
    (N, n)."""

    residual: np.ndarray
    """Settled residuals [Nm]."""
    qd: np.ndarray
    """Joint velocities [rad/s]."""
    friction: np.ndarray
    """Values of the friction formula [Nm]."""
    timing_variance: np.ndarray
    """Variance due to the instants of the samples [Nm^2]."""
    inertia_torque: np.ndarray
    """Inertia torques, low-passed as the residuals are [Nm]."""
    dt: float
    """Usual time between two samples [s]: at a lower rate more of the noise is in the residuals."""


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations for a scene. n joints."""

    noise: np.ndarray
    """Of one sample [Nm], shape (n,)."""
    friction_error: np.ndarray
    """Of friction between recordings, relative, shape (n,)."""
    model_error: np.ndarray
    """Of the model in motion, a factor on friction apart [Nm], shape (n,)."""
    inertia_torque_error: np.ndarray
    """Of the inertia torque, relative, in addition to `model_error`, shape (n,)."""
    rest_error: np.ndarray
    """Of the model at rest and reversals, in addition to `model_error` [Nm], shape (n,); NaN if the joint was
    never at rest."""
    rest_velocity: float
    """Velocity below which `rest_error` applies [rad/s]."""
    average_error: np.ndarray
    """Standard deviation of the model errors in the average of the residuals, relative to that in a sample,
    shape (n,)."""

    def model_variance(self, speed: np.ndarray, inertia_torque: np.ndarray) -> np.ndarray:
        """Variance of the model error in samples with these speeds [rad/s] and squares of the inertia torque
        [Nm^2], shape (N, n) [Nm^2]."""
        at_rest = np.nan_to_num(self.rest_error) ** 2 / (1.0 + (speed / self.rest_velocity) ** 2) ** 2
        variance: np.ndarray = self.model_error**2 + self.inertia_torque_error**2 * inertia_torque + at_rest
        return variance


class _Samples(NamedTuple):
    """Residuals of one joint and the variances known of them, shape (N,) each."""

    residual: np.ndarray
    slow: np.ndarray
    """The slow part of the residual [Nm]."""
    noise: np.ndarray
    """Variance of the residual from noise [Nm^2]."""
    known: np.ndarray
    """The same with that due to the instants of the samples [Nm^2]."""
    inertia_torque: np.ndarray
    """Square of the inertia torque [Nm^2]."""
    slow_inertia_torque: np.ndarray
    """Square of its slow part [Nm^2]."""

    def where(self, used: np.ndarray) -> "_Samples":
        """The samples that are used."""
        return _Samples(
            self.residual[used],
            self.slow[used],
            self.noise[used],
            self.known[used],
            self.inertia_torque[used],
            self.slow_inertia_torque[used],
        )


def estimate_noise(recordings: Sequence[JointResiduals], bandwidth: float) -> NoiseLevels:
    """Noise and model error of the joints, from one or more recordings.

    Args:
        recordings: Residuals of each recording.
        bandwidth: Cut-off frequency of the residuals [Hz].
    """
    steps = [part.dt for part in recordings]
    factors = [_factor(part.residual, part.friction) for part in recordings]
    error = _between_recordings(factors)
    residual = [
        part.residual - np.nan_to_num(a) * part.friction for part, a in zip(recordings, factors, strict=True)
    ]
    inertia_torque = [part.inertia_torque for part in recordings]
    speed = np.abs(np.vstack([part.qd for part in recordings]))
    residuals, slow = np.vstack(residual), _slow(residual, steps)
    # Variance of a residual over that of white noise in one sample, which all recordings have in common.
    gain = np.vstack(
        [
            np.full((len(part), 1), noise_variance_ratio(bandwidth, dt))
            for part, dt in zip(residual, steps, strict=True)
        ]
    )
    of_sample = np.maximum(MAD_SCALE * np.median(np.abs(residuals - slow) / np.sqrt(gain), axis=0), 1e-6)
    noise = gain * of_sample**2
    known = noise + np.vstack([part.timing_variance for part in recordings])
    square, slow_square = np.vstack(inertia_torque) ** 2, _slow(inertia_torque, steps) ** 2
    joints = [
        _Samples(residuals[:, j], slow[:, j], noise[:, j], known[:, j], square[:, j], slow_square[:, j])
        for j in range(residuals.shape[1])
    ]

    def levels(velocity: float) -> NoiseLevels:
        found = [_model_error(samples, speed[:, j], velocity) for j, samples in enumerate(joints)]
        model, inertia, rest = np.array(found).T
        unknown = np.ones(len(model))
        return NoiseLevels(of_sample, error, model, inertia, rest, velocity, unknown)

    def cost(found: NoiseLevels) -> float:
        return _cost(residuals, known + found.model_variance(speed, square))

    best = min(map(levels, _REST_VELOCITIES), key=cost)
    averages, ratio = _averages(residual, steps, bandwidth)
    model = best.model_variance(speed, square)
    share = _share_in_average(averages, known + (ratio - 1.0) * noise, model, float(ratio.max()))
    return replace(best, average_error=np.sqrt(share))


def _averages(
    parts: list[np.ndarray], steps: Sequence[float], bandwidth: float
) -> tuple[np.ndarray, np.ndarray]:
    """EWMA of the residuals of all recordings, whose samples are so far apart [s], shape (N, n); and the
    variance of its noise over that of a residual, which is an Ornstein-Uhlenbeck process, shape (N, 1)."""
    K = 2.0 * math.pi * bandwidth
    averages, ratios = [], []
    for part, dt in zip(parts, steps, strict=True):
        if not len(part):
            continue
        weight, correlation = -math.expm1(-RELATIVE_BANDWIDTH * K * dt), math.exp(-K * dt)
        keep = 1.0 - weight
        # The start of a recording counts as if the first residual had lasted.
        averages.append(lfilter([weight], [1.0, -keep], part, axis=0, zi=keep * part[:1])[0])
        covariance = weight / (1.0 - keep * correlation)
        variance = (2.0 * weight * keep * correlation * covariance + weight**2) / (1.0 - keep**2)
        ratios.append(np.full((len(part), 1), variance))
    return np.vstack(averages), np.vstack(ratios)


def _share_in_average(averages: np.ndarray, known: np.ndarray, model: np.ndarray, least: float) -> np.ndarray:
    """Variance of the model error in the averages over that in a sample, shape (n,): on average, and in the
    tail. It is above 1 if what counts as noise is not white.

    Args:
        averages: Of the residuals, shape (N, n) [Nm].
        known: Their variance from noise and the instants of the samples, shape (N, n) [Nm^2].
        model: Variance of the model error in a sample, shape (N, n) [Nm^2].
        least: The same share of white noise: no error of a model averages out better.
    """
    if len(averages) < _MIN_TAIL_SAMPLES:
        return np.ones(averages.shape[1])
    is_perfect = model.max(axis=0) < _LEAST_VARIANCE
    model = np.maximum(model, _LEAST_VARIANCE)
    mean = np.mean(averages**2 - known, axis=0) / np.mean(model, axis=0)
    tail = np.quantile(((averages / _TAIL_SIGMA) ** 2 - known) / model, _TAIL, axis=0)
    return np.where(is_perfect, 1.0, np.maximum(np.maximum(mean, tail), least))


def _slow(parts: list[np.ndarray], steps: Sequence[float]) -> np.ndarray:
    """Slow part of quantities of all recordings, whose samples are so far apart [s], shape (N, n)."""
    return np.vstack(
        [
            uniform_filter1d(part, max(3, round(_AVERAGING_TIME / dt)), axis=0)
            for part, dt in zip(parts, steps, strict=True)
        ]
    )


def _cost(residual: np.ndarray, variance: np.ndarray) -> float:
    """Twice the negative log likelihood of Gaussian residuals, per sample and up to a constant."""
    return float(np.mean(residual**2 / variance + np.log(variance)))


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


def _model_error(samples: _Samples, speed: np.ndarray, velocity: float) -> tuple[float, float, float]:
    """`NoiseLevels.model_error`, `inertia_torque_error` and `rest_error` of one joint, with that velocity
    between motion and rest. `speed`: of the joint, shape (N,) [rad/s]."""
    moving, low = speed > 3.0 * velocity, speed < velocity
    used = moving if moving.sum() >= _MIN_TAIL_SAMPLES else ~low
    if not used.any():
        used = np.ones(len(speed), dtype=bool)
    model, inertia = _error_in_motion(samples.where(used))
    rest = np.nan
    if low.any():
        # A joint nearly at rest vibrates with those that stop hard: the instants of the samples and the
        # inertia torque do not explain that.
        values, noise = samples.residual[low], samples.noise[low]
        total = max(float(np.mean(values**2 - noise)), _excess_variance(values, noise))
        # At the limit itself a quarter of the full variance remains: on average about half.
        rest = np.sqrt(2.0 * max(total - model**2, 0.0))
    return model, inertia, float(rest)


def _error_in_motion(samples: _Samples) -> tuple[float, float]:
    """Model error in any motion [Nm], and in proportion to the inertia torque: the most likely pair that
    includes the tail."""

    def model_variance(inertia: float) -> float:
        slow = np.mean(samples.slow**2 - inertia**2 * samples.slow_inertia_torque)
        known = samples.known + inertia**2 * samples.inertia_torque
        return max(float(slow), _excess_variance(samples.residual, known), 0.0)

    def cost(inertia: float) -> float:
        variance = samples.known + model_variance(inertia) + inertia**2 * samples.inertia_torque
        return _cost(samples.residual, variance)

    best = min(_INERTIA_TORQUE_ERRORS, key=cost)
    return float(np.sqrt(model_variance(best))), best


def _excess_variance(values: np.ndarray, known_variance: np.ndarray) -> float:
    """Variance to be added to the known one of each value, so that one in a thousand exceeds 3.29 standard
    deviations as in a Gaussian tail; zero for few values."""
    if len(values) < _MIN_TAIL_SAMPLES:
        return 0.0
    return max(float(np.quantile((values / _TAIL_SIGMA) ** 2 - known_variance, _TAIL)), 0.0)
