"""Contacts in recordings that were meant to be free of them, found in the residuals of a fitted model.

The residuals are averaged over a window and divided by their own spread over the recording, a median absolute
deviation, which contains model error and noise but hardly any contact, as long as the arm is touched for less
than half of the time. The uncertainty of the model's parameters adds to it. Their squared length is the
energy of a window. Without contact it is a chi-square variable of as many degrees of freedom as there are
channels; the tails of model errors are heavier, by a factor that was measured on real arms (`_TAILS`). Around
each window beyond this limit, everything above the level of ordinary windows belongs to the contact
(thresholds with hysteresis).

Friction is not taken for a contact: the spread of slow and of fast motion is measured apart, and a joint at
rest may hold any torque up to its Coulomb friction. While the arm rests, the change of the torques counts as
well (`contactsense.calibration.contacts.rest_test`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import chdtri

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.contacts.rest_test import changes_at_rest
from contactsense.calibration.contacts.trimmed_fit import WINDOW
from contactsense.calibration.fit.robust_least_squares import MAD_SCALE
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.equations import all_residuals, measured_channels
from contactsense.calibration.residuals.recording_residuals import recently_moved, settled_samples

_SLOW = 0.05
"""Below this velocity friction has hysteresis, and a spread of its own [rad/s]."""
_MIN_SAMPLES = 50
"""With fewer samples of slow or of fast motion, these have no spread of their own."""
_CONTACT_PROBABILITY = 1e-6
"""Of a window without contact above the upper threshold, if model errors were Gaussian."""
_ORDINARY_PROBABILITY = 0.01
"""The same for the lower threshold, at which a contact begins and ends."""
_TAILS = 2.0
"""Model errors in motion without contact reach this many times the size of Gaussian ones of the same median.
"""
_MARGIN = 0.25
"""Left out before and after a contact: half a window, and the time in which the observer settles [s]."""
_PAUSE = 0.5
"""Contacts closer to each other than this are one [s]."""
_FELT = 4.0
"""A contact appears on the channels beyond this many standard deviations, at rest by the joints whose torque
changes by more than Coulomb friction."""


@dataclass(frozen=True)
class SuspectedContact:
    """A stretch of a recording in which something seems to push on the arm."""

    recording: str
    """Name of the recording."""
    start: float
    stop: float
    """Since the first sample of the recording's stretch [s]."""
    first_row: int
    last_row: int
    """Rows of the file, from 0."""
    channels: tuple[int, ...]
    """Equations in which it appears, strongest first: joints, then n + 0..5 for the base wrench, then six
    for each sensor within the arm."""
    peak: tuple[float, ...]
    """Largest residual of each, averaged over a window [Nm, or N for a force]."""

    def within(self, recording: FreeMotion) -> bool:
        """Whether it is in this recording, or in this stretch of one."""
        first, last = recording.row_of(0), recording.row_of(-1)
        return self.recording == recording.name and first <= self.first_row <= self.last_row <= last


def suspected_contacts(
    arm: CalibrationModel, recording: FreeMotion, bandwidth: float, uncertainty: np.ndarray | None = None
) -> tuple[np.ndarray, tuple[SuspectedContact, ...]]:
    """Where something seems to push on the arm.

    Args:
        arm: The model that was fitted to the recording.
        recording: The motion; samples that it already leaves out do not count for the spread.
        bandwidth: Cut-off frequency of the observer [Hz].
        uncertainty: Standard deviation of each averaged residual that follows from that of the model's
            parameters, shape (N, C); None: zero.

    Returns:
        Which samples are free of contacts, shape (N,), bool; and the contacts in the others.
    """
    joints = recording.q.shape[1]
    used = measured_channels(arm.scene, [recording])
    settled = settled_samples(recording, bandwidth)
    dt = float(np.median(np.diff(recording.t)))
    residual = all_residuals(arm, recording, bandwidth)
    residual[:settled] = 0.0
    mean = uniform_filter1d(residual, max(3, round(WINDOW / dt)), axis=0)
    excess = np.abs(mean)
    # A joint at rest holds any torque up to Coulomb friction.
    excess[:, :joints] -= np.where(recently_moved(recording), 0.0, arm.coulomb)
    known = recording.usable.copy()
    known[:settled] = False
    slow = np.zeros(mean.shape, dtype=bool)
    slow[:, :joints] = np.abs(recording.qd) < _SLOW
    spread = _spread(np.abs(mean), slow, known)
    if uncertainty is not None:
        spread = np.hypot(spread, uncertainty)
    score = (np.maximum(excess, 0.0) / spread)[:, used]
    energy = np.sum(score**2, axis=1)
    channels = np.flatnonzero(used)
    ordinary = float(chdtri(len(channels), _ORDINARY_PROBABILITY))
    limit = _TAILS**2 * float(chdtri(len(channels), _CONTACT_PROBABILITY))
    if recording.torque is not None:
        change, size = changes_at_rest(arm, recording, mean[:, :joints], settled)
        energy = np.maximum(energy, limit * size)
        score[:, :joints] = np.maximum(score[:, :joints], _FELT * np.abs(change))
    free = np.ones(len(energy), dtype=bool)
    contacts = []
    for begin, end in _runs(energy, ordinary, limit, recording.t):
        free[begin:end] = False
        peak = score[begin:end].max(axis=0)
        felt = [int(i) for i in np.argsort(-peak) if peak[i] > _FELT]
        contacts.append(
            SuspectedContact(
                recording.name,
                float(recording.t[begin] - recording.t[0]),
                float(recording.t[end - 1] - recording.t[0]),
                recording.row_of(begin),
                recording.row_of(end - 1),
                tuple(int(channels[i]) for i in felt),
                tuple(float(np.abs(mean[begin:end, channels[i]]).max()) for i in felt),
            )
        )
    return free, tuple(contacts)


def _spread(size: np.ndarray, slow: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Standard deviation of each averaged residual, at least that of the whole recording, shape (N, C)."""
    spread = np.empty_like(size)
    for c in range(size.shape[1]):
        overall = max(MAD_SCALE * float(np.median(size[known, c])), 1e-9)
        spread[:, c] = overall
        for part in (slow[:, c], ~slow[:, c]):
            if np.count_nonzero(part & known) >= _MIN_SAMPLES:
                spread[part, c] = max(overall, MAD_SCALE * float(np.median(size[part & known, c])))
    return spread


def _runs(energy: np.ndarray, ordinary: float, limit: float, t: np.ndarray) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of each stretch above `ordinary` that reaches `limit`, with
    margins; close ones are joined."""
    above = np.flatnonzero(energy > ordinary)
    if not len(above):
        return []
    runs = np.split(above, np.flatnonzero(np.diff(above) > 1) + 1)
    found: list[tuple[int, int]] = []
    for run in runs:
        if energy[run].max() > limit:
            begin = int(np.searchsorted(t, t[run[0]] - _MARGIN))
            end = int(np.searchsorted(t, t[run[-1]] + _MARGIN, side="right"))
            if found and t[begin] - t[found[-1][1] - 1] < _PAUSE:
                found[-1] = (found[-1][0], end)
            else:
                found.append((begin, end))
    return found
