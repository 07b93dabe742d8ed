"""Where recordings are compared: at instants far enough apart, with nodes about each.

Values at a node are means over the time between two instants. The low-pass filter does not take away the
noise of the velocities: as momentum it is in the filter's output at once, sample by sample. Its mean over so
many samples is small, and readings and model have the same mean. Otherwise the noise of a real arm's
velocities (0.001 rad/s and more) would hide what a sensor with little noise tells.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP
from contactsense.residuals.momentum_observer import noise_variance_ratio

BANDWIDTH = 2.0
"""Cut-off frequency of the filter [Hz]: slow motion lies below it, most of the noise above."""
_INTERVAL = 0.25
"""Time between rows [s], three time constants of the filter: white noise is nearly independent between them.
"""
_NODE_INTERVAL = 0.05
"""Time between the nodes about an instant [s]."""
_AVERAGED = 2
"""Intervals of nodes before and after that of a node over which its values are means, besides its own."""
_AVERAGED_TIME = (2 * _AVERAGED + 1) * _NODE_INTERVAL
"""The same [s]; no longer than `_INTERVAL`, so that successive instants share no sample."""
_SETTLING = 12.0
"""Time constants until the filter has forgotten its start: even a bias of a thousand newtons."""
SETTLING_TIME = _SETTLING / (2.0 * np.pi * BANDWIDTH)
"""The same [s]."""
_MOTION_INTERVAL = 0.02
"""The motion is followed at steps of at most this length, or of one sample [s]."""
MIDDLE = 2
"""Place of the instant itself among its nodes."""
_MAX_ROWS = 400
"""Longer recordings have rows at larger intervals."""


@dataclass(frozen=True)
class Instants:
    """The M instants of one recording."""

    motion: np.ndarray
    """Indices of the samples at which the motion is followed, shape (K,): it is smooth, unlike the readings.
    """
    start: int
    """The first of those samples that is used."""
    stride: int
    """How many of them make an interval between two nodes."""
    nodes: np.ndarray
    """Numbers of the intervals at the nodes of each instant, shape (M, 5): two before it, its own, two after.
    """

    @property
    def intervals(self) -> int:
        """Number of intervals."""
        return (len(self.motion) - self.start) // self.stride

    def averages(self, means: np.ndarray) -> np.ndarray:
        """Values at the nodes, shape (M, 5, ...), from those of the intervals, shape (intervals, ...)."""
        near = range(-_AVERAGED, _AVERAGED + 1)
        return np.asarray(sum(means[self.nodes + k] for k in near) / len(near))

    def averages_of(self, values: np.ndarray) -> np.ndarray:
        """The same from the values at all samples of the recording, shape (N, ...)."""
        end = self.start + self.intervals * self.stride
        used = values[self.motion[self.start : end]]
        return self.averages(used.reshape(self.intervals, self.stride, *values.shape[1:]).mean(axis=1))

    def node_times(self, t: np.ndarray) -> np.ndarray:
        """Times of the nodes after the instant, shape (M, 5) [s]; `t`: those of the recording, shape (N,)."""
        times = self.averages_of(t)
        return np.asarray(times - times[:, MIDDLE, None])


def instants(recordings: list[FreeMotion]) -> list[Instants]:
    """The instants of each recording."""
    interval = max(_INTERVAL, sum(part.seconds for part in recordings) / _MAX_ROWS)
    found = []
    for part in recordings:
        motion = _motion_samples(part.t)
        t = part.t[motion]
        start = int(np.searchsorted(t, t[0] + SETTLING_TIME))
        stride = max(1, round(_NODE_INTERVAL / float(np.median(np.diff(t)))))
        margin, count = MIDDLE + _AVERAGED, (len(t) - start) // stride
        middle = np.arange(margin, count - margin, max(1, round(interval / _NODE_INTERVAL)))
        found.append(Instants(motion, start, stride, middle[:, None] + np.arange(-MIDDLE, MIDDLE + 1)))
    return found


def averaged_noise(dt: float) -> float:
    """Variance of white noise in the values at a node over that of single samples, which are `dt` [s] apart:
    that of the filter, then of its mean, as if it were that of a continuous signal."""
    ratio = 2.0 * np.pi * BANDWIDTH * _AVERAGED_TIME
    mean = 2.0 / ratio * (1.0 - (1.0 - np.exp(-ratio)) / ratio)
    return float(noise_variance_ratio(BANDWIDTH, dt) * mean)


def at_delay(terms: np.ndarray, nodes: np.ndarray, delay: float) -> np.ndarray:
    """Terms `delay` [s] before each instant, shape (M, ...): on the parabola through the three nearest nodes.

    The prediction is interpolated rather than the readings, whose noise would change with the delay.

    Args:
        terms: At all nodes, shape (M, 5, ...).
        nodes: Times of the nodes after the instant [s], shape (M, 5).
        delay: Up to about 0.1 s, either way.
    """
    if delay == 0.0:
        return terms[:, MIDDLE]
    nearest = int(np.abs(np.median(nodes, axis=0) + delay).argmin())
    first = min(max(nearest - 1, 0), nodes.shape[1] - 3)
    near = slice(first, first + 3)
    return np.asarray(np.einsum("mk,mk...->m...", _lagrange(nodes[:, near], -delay), terms[:, near]))


def _lagrange(nodes: np.ndarray, at: float) -> np.ndarray:
    """Weights of the parabola through the values at three nodes, shape (M, 3), for its value at `at`."""
    a, b, c = nodes.T
    return np.column_stack(
        (
            (at - b) * (at - c) / ((a - b) * (a - c)),
            (at - a) * (at - c) / ((b - a) * (b - c)),
            (at - a) * (at - b) / ((c - a) * (c - b)),
        )
    )


def _motion_samples(t: np.ndarray) -> np.ndarray:
    """Indices of samples `_MOTION_INTERVAL` apart, closer where samples are missing: a longer step between
    two is one of the recording, so the filter starts anew for the motion where it does for the readings.
    """
    last = np.searchsorted(t, t + (_MOTION_INTERVAL + 1e-6), side="right") - 1
    samples = [0]
    while samples[-1] < len(t) - 1:
        samples.append(max(samples[-1] + 1, int(last[samples[-1]])))
    return np.array(samples)


def without_gaps(recordings: list[FreeMotion]) -> list[FreeMotion]:
    """The recordings cut where samples are missing for so long that the filter starts anew; parts in which it
    does not settle are left out."""
    found = []
    for whole in recordings:
        cuts = np.flatnonzero(np.diff(whole.t) > GAP) + 1
        found += [
            whole.part(rows)
            for rows in np.split(np.arange(len(whole.t)), cuts)
            if len(rows) > 2 and whole.t[rows[-1]] - whole.t[rows[0]] > SETTLING_TIME
        ]
    return found
