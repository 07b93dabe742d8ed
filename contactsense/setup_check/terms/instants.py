"""Which samples of recordings are compared: instants far enough apart, with nodes about each."""

from dataclasses import dataclass

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP

BANDWIDTH = 2.0
"""Cut-off frequency of the filter [Hz]: slow motion lies below it, most of the noise above."""
_INTERVAL = 0.25
"""Time between rows [s], three time constants of the filter: white noise is nearly independent between them.
"""
_SETTLING = 12.0
"""Time constants until the filter has forgotten its start: even a bias of a thousand newtons."""
SETTLING_TIME = _SETTLING / (2.0 * np.pi * BANDWIDTH)
"""The same [s]."""
_MOTION_INTERVAL = 0.02
"""The motion is followed at steps of at most this length, or of one sample [s]."""
_NODE_INTERVAL = 0.05
"""Time between the nodes about an instant [s]."""
MIDDLE = 2
"""Place of the instant itself among its nodes."""
_MAX_ROWS = 400
"""Longer recordings have rows at larger intervals."""


@dataclass(frozen=True)
class Instants:
    """Which samples of one recording are used."""

    motion: np.ndarray
    """Indices of the samples at which the motion is followed, shape (K,): it is smooth, unlike the readings.
    """
    keep: slice
    """All nodes, among those samples."""
    nodes: np.ndarray
    """Indices of the nodes of each instant within `keep`, shape (M, 5): two before it, itself, two after."""
    samples: np.ndarray
    """Index of each instant's sample in the recording, shape (M,)."""

    def node_times(self, t: np.ndarray) -> np.ndarray:
        """Times of the nodes after the instant, shape (M, 5) [s]; `t`: those of the recording, shape (N,)."""
        times = t[self.motion][self.keep]
        return np.asarray(times[self.nodes] - times[self.nodes[:, MIDDLE]][:, None])


def instants(recordings: list[FreeMotion]) -> list[Instants]:
    """The instants of each recording."""
    interval = max(_INTERVAL, sum(part.seconds for part in recordings) / _MAX_ROWS)
    found = []
    for part in recordings:
        motion = _motion_samples(part.t)
        t = part.t[motion]
        start = int(np.searchsorted(t, t[0] + SETTLING_TIME))
        stride = max(1, round(_NODE_INTERVAL / float(np.median(np.diff(t)))))
        count = len(range(start, len(t), stride))
        middle = np.arange(MIDDLE, count - MIDDLE, max(1, round(interval / _NODE_INTERVAL)))
        nodes = middle[:, None] + np.arange(-MIDDLE, MIDDLE + 1)
        found.append(Instants(motion, slice(start, None, stride), nodes, motion[start + stride * middle]))
    return found


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
