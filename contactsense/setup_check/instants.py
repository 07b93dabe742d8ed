"""Which samples of recordings are compared: instants far enough apart, with nodes about each."""

from dataclasses import dataclass

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.recording_residuals import GAP

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
"""The motion is followed at steps of at most this length, and of at least one sample [s]."""
_NODE_INTERVAL = 0.05
"""Time between the nodes about an instant [s]."""
_MAX_ROWS = 400
"""Longer recordings have rows at larger intervals."""


@dataclass(frozen=True)
class Instants:
    """Which samples of one recording are used."""

    every: int
    """The motion is followed at every n-th sample: it is smooth, unlike the readings."""
    keep: slice
    """All nodes, among those samples."""
    nodes: np.ndarray
    """Indices of the nodes of each instant within `keep`, shape (M, 3)."""
    samples: np.ndarray
    """Index of each instant's sample in the recording, shape (M,)."""

    def node_times(self, t: np.ndarray) -> np.ndarray:
        """Times of the nodes after the instant, shape (M, 3) [s]; `t`: those of the recording, shape (N,)."""
        times = t[:: self.every][self.keep]
        return np.asarray(times[self.nodes] - times[self.nodes[:, 1]][:, None])


def instants(recordings: list[FreeMotion]) -> list[Instants]:
    """The instants of each recording."""
    interval = max(_INTERVAL, sum(part.seconds for part in recordings) / _MAX_ROWS)
    found = []
    for part in recordings:
        dt = float(np.median(np.diff(part.t)))
        every = max(1, int(_MOTION_INTERVAL / dt + 1e-6))
        t = part.t[::every]
        start = int(np.searchsorted(t, t[0] + SETTLING_TIME))
        stride = max(1, round(_NODE_INTERVAL / (every * dt)))
        count = len(range(start, len(t), stride))
        middle = np.arange(1, count - 1, max(1, round(interval / _NODE_INTERVAL)))
        nodes = middle[:, None] + np.array([-1, 0, 1])
        found.append(Instants(every, slice(start, None, stride), nodes, every * (start + stride * middle)))
    return found


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
