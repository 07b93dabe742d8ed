"""Motions of a touched arm: standstill, slow or fast, at rest in the first and in the last sample.

Each joint follows a sum of three sines of a path parameter. That runs with time except at the ends, where its
rate rises from 0 to 1 and falls again within one second. Speeds and accelerations have closed forms.
"""

from typing import NamedTuple

import numpy as np

from . import arrays
from .arm import Arm
from .postures import Postures

KINDS = ("standstill", "slow", "fast")
_PEAKS = {1: (0.03, 0.12), 2: (0.3, 0.6)}
"""Kind -> range of the peak speed of a joint, in parts of its limit."""
_FREQUENCIES = {1: (0.05, 0.2), 2: (0.2, 0.5)}
"""Kind -> range of the sines' frequencies [Hz]."""
_SINES = 3
BLEND = 1.0
"""Duration of the start and of the stop [s]."""
CHECKED = 20
"""Samples between two checks of posture and exposure: 40 ms."""


class Trajectory(NamedTuple):
    """N samples of the joints, shape (N, n) each [rad, rad/s, rad/s^2]."""

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


def draw(arm: Arm, postures: Postures, kind: int, samples: int, rng: np.random.Generator) -> Trajectory:
    """A random motion without collision.

    Args:
        arm: The arm.
        postures: Its test for collisions.
        kind: Index in `KINDS`.
        samples: Number N of samples.
        rng: Random numbers.
    """
    if kind == 0:
        q = np.tile(postures.draw(rng), (samples, 1))
        return Trajectory(arrays.on_grid(q, arrays.POSITION), np.zeros_like(q), np.zeros_like(q))
    low, high = arm.limits
    while True:
        q, qd, qdd = _sines(arm.speeds, kind, samples, rng)
        q += postures.draw(rng) - q[0]
        inside = (q >= low).all() and (q <= high).all()
        if inside and all(postures.free(posture) for posture in q[::CHECKED]):
            return Trajectory(
                arrays.on_grid(q, arrays.POSITION),
                arrays.on_grid(qd, arrays.SPEED),
                arrays.on_grid(qdd, arrays.ACCELERATION),
            )


def _sines(
    limits: np.ndarray, kind: int, samples: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions about any place, speeds and accelerations."""
    shape = (len(limits), _SINES)
    omega = 2.0 * np.pi * rng.uniform(*_FREQUENCIES[kind], shape)
    weight = rng.uniform(0.3, 1.0, shape) / omega
    phase = rng.uniform(0.0, 2.0 * np.pi, shape)
    along, rate, rate_change = _progress(np.arange(samples) / arrays.RATE)
    angle = omega * along[:, None, None] + phase
    p = (weight * np.sin(angle)).sum(axis=2)
    dp = (weight * omega * np.cos(angle)).sum(axis=2)
    ddp = (-weight * omega**2 * np.sin(angle)).sum(axis=2)
    qd = dp * rate[:, None]
    scale = rng.uniform(*_PEAKS[kind], len(limits)) * limits / np.abs(qd).max(axis=0)
    qdd = ddp * rate[:, None] ** 2 + dp * rate_change[:, None]
    return scale * p, scale * qd, scale * qdd


def _progress(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Path parameter [s] over time [s], its rate and the change of that [1/s], shape (N,) each."""
    along, rate, change = _start(np.minimum(t, t[-1] / 2.0))
    back, back_rate, back_change = _start(np.minimum(t[-1] - t, t[-1] / 2.0))
    early = t <= t[-1] / 2.0
    middle = _start(np.array([t[-1] / 2.0]))[0]
    return (
        np.where(early, along, 2.0 * middle - back),
        np.where(early, rate, back_rate),
        np.where(early, change, -back_change),
    )


def _start(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same without an end."""
    blending = t < BLEND
    phase = np.pi * np.minimum(t, BLEND) / BLEND
    along = np.where(blending, 0.5 * (t - BLEND / np.pi * np.sin(phase)), t - 0.5 * BLEND)
    return along, 0.5 * (1.0 - np.cos(phase)), np.where(blending, 0.5 * np.pi / BLEND * np.sin(phase), 0.0)
