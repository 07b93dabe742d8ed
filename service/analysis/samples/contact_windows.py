"""The measurements of one contact, split into windows: the mean of each sensor, without its low-pass.

The observer's residual r follows the external part x by dr/dt = K (x - r). So the mean of x over a window of
length T is mean(r) + (r(end) - r(begin)) / (K T), and the white noise of one sample is divided by the samples
of the window: windows are independent of each other, which residuals of neighbouring samples are not.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.service.analysis.samples.contact_history import ContactHistory

SHORTEST, LONGEST = 0.02, 0.1
"""Minimum duration of windows and, while there are fewer than `MOST`, maximum duration [s]."""
FEWEST, MOST = 12, 24
"""Number of windows of a contact that is long enough, unless the arm moves too fast for so few. The force is
free in each window, so its changes by noise from one window to the next count as evidence: few windows are
better."""
LARGEST_TURN = 0.2
"""Maximum rotation of a joint within a window [rad]."""
LIMIT = 400
"""Maximum number of windows, however fast the arm moves."""


@dataclass(frozen=True, eq=False)
class ContactWindows:
    """W windows of one contact."""

    t: np.ndarray
    """Middle of each [s], shape (W,)."""
    weighted_t: np.ndarray
    """Mean time of each, weighted by the force, shape (W,) [s]: the mean wrench of a contact that slides is
    that at the place of this time."""
    samples: np.ndarray
    """Samples in each, shape (W,)."""
    q: np.ndarray
    """Joint positions in the middle [rad], shape (W, n)."""
    base_wrench: np.ndarray
    """Mean external base wrench, base axes, base origin [N, Nm], shape (W, 6)."""
    joint_torque: np.ndarray
    """Mean external torque about each joint [Nm], shape (W, n)."""
    edges: np.ndarray
    """Samples of the contact at which the windows begin and end, shape (W + 1,), int64."""


def contact_windows(history: ContactHistory, bandwidth: float) -> ContactWindows | None:
    """Split a contact into windows; None if it is too short for one.

    Args:
        history: The contact.
        bandwidth: Cut-off of the observers [Hz].
    """
    t = history.t
    duration = float(t[-1] - t[0])
    if len(t) < 4 or duration < SHORTEST:
        return None
    fastest = float(np.max(np.abs(history.block.qd), initial=0.0))
    length = duration / min(max(duration / LONGEST, FEWEST), MOST)
    length = min(length, LARGEST_TURN / max(fastest, 1e-9))
    length = max(length, SHORTEST, duration / LIMIT)
    count = max(int(duration / length), 1)
    # A time step is not split.
    edges = np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], count + 1)))
    begin, end = edges[:-1], edges[1:]
    whole = t[end] - t[begin]
    K = 2.0 * np.pi * bandwidth
    means = []
    for r in (history.base_wrench, history.joint_torque):
        steps = np.diff(t)[:, None] * 0.5 * (r[1:] + r[:-1])
        total = np.concatenate((np.zeros((1, r.shape[1])), np.cumsum(steps, axis=0)))
        means.append(((total[end] - total[begin]) + (r[end] - r[begin]) / K) / whole[:, None])
    middle = 0.5 * (t[begin] + t[end])
    q = np.column_stack([np.interp(middle, t, column) for column in history.block.q.T])
    return ContactWindows(
        middle,
        _weighted_times(history, edges, means[0][:, :3], K),
        (end - begin).astype(np.float64),
        q,
        means[0],
        means[1],
        edges,
    )


def _weighted_times(history: ContactHistory, edges: np.ndarray, mean: np.ndarray, K: float) -> np.ndarray:
    """Mean time of each window, weighted by the force in the direction of its mean; `mean`: forces, shape
    (W, 3) [N]; `K`: of the observer [1/s]."""
    t, r = history.t, history.base_wrench[:, :3]
    a = np.exp(-K * np.diff(t))[:, None]
    force = (r[1:] - a * r[:-1]) / (1.0 - a)
    weight = np.abs(np.einsum("ni,ni->n", force, np.repeat(mean, np.diff(edges), axis=0))) * np.diff(t)
    middle = 0.5 * (t[1:] + t[:-1])
    total, moment = (np.add.reduceat(values, edges[:-1]) for values in (weight, weight * middle))
    even = 0.5 * (t[edges[1:]] + t[edges[:-1]])
    return np.where(total > 0.0, moment / np.where(total > 0.0, total, 1.0), even)
