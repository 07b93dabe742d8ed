"""Contacts with an arm at rest, found in the change of the joint torques while nothing moves.

A joint at rest holds any torque up to its Coulomb friction, so the size of its residual says little. But what
friction holds hardly changes by itself: at rest the controller and the creep of the gear grease move it by
less than Coulomb friction. So the residuals are compared with their median over the seconds around them, in
units of Coulomb friction. That takes no fit, and finds the pushes in a recording in which the arm only rests.
After a push friction may hold another torque than before, which is the reference from then on.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.robots.torque_scale import torque_scales

_CONTACT, _EDGE = 1.5, 1.0
"""A contact changes the torques by at least the first multiple of Coulomb friction, in the Euclidean norm
over the joints; it begins and ends at the second. Friction of one joint changes by 2 at most, from one
direction to the other."""
_LEAST_FRICTION = 0.03
"""Coulomb friction is taken to be at least this fraction of a joint's torque limit: that of a UR10e's drives
is 0.03 to 0.05, and a recording without motion does not show it."""
_REFERENCE = 5.0
"""The median is taken over this time, of which a contact may fill less than half [s]."""
_MIN_SECONDS = 2.0
"""Shortest stretch of rest whose median is a reference [s]."""
_STEP = 0.05
"""Residuals are averaged over a longer time; the median takes one of each such interval [s]."""
_REST_WINDOW, _REST_RANGE = 2.0, 5e-3
"""The arm rests where no joint's positions differ by more than the second [rad] within the first [s] about a
sample, nor within the whole stretch. A push on an arm at rest moves it by 1 to 2 mrad."""


def changes_at_rest(
    arm: CalibrationModel, recording: FreeMotion, residual: np.ndarray, settled: int
) -> tuple[np.ndarray, np.ndarray]:
    """Change of the torques since the arm came to rest.

    Args:
        arm: The model that was fitted to the recording.
        recording: The motion.
        residual: Averaged residuals of the joint torques, shape (N, n) [Nm].
        settled: First sample at which they can be used.

    Returns:
        The change of each joint in units of Coulomb friction, shape (N, n); and its squared length relative
        to that of the smallest contact, shape (N,). Both are zero in motion, in short stretches of rest, and
        where the length is less than that at which a contact ends.
    """
    scale = np.maximum(arm.coulomb, _LEAST_FRICTION * torque_scales(arm.scene.robot))
    change = np.zeros_like(residual)
    dt = float(np.median(np.diff(recording.t)))
    window = max(3, round(_REST_WINDOW / dt))
    span = maximum_filter1d(recording.q, window, axis=0) - minimum_filter1d(recording.q, window, axis=0)
    rest = settled + np.flatnonzero(span[settled:].max(axis=1) < _REST_RANGE)
    for stretch in np.split(rest, np.flatnonzero(np.diff(rest) > 1) + 1):
        if (
            len(stretch)
            and recording.t[stretch[-1]] - recording.t[stretch[0]] >= _MIN_SECONDS
            and np.ptp(recording.q[stretch], axis=0).max() < _REST_RANGE
        ):
            change[stretch] = (residual[stretch] - _running_median(residual[stretch], dt)) / scale
    square = np.sum(change**2, axis=1)
    change[square < _EDGE**2] = 0.0
    return change, np.where(square < _EDGE**2, 0.0, square / _CONTACT**2)


def _running_median(values: np.ndarray, dt: float) -> np.ndarray:
    """Median over `_REFERENCE` about each sample, within the stretch: near its ends the first or last such
    time. Shape as `values`, (N, n)."""
    step = max(1, round(_STEP / dt))
    part = values[::step]
    window = min(len(part), max(1, round(_REFERENCE / (step * dt))))
    medians = np.median(np.lib.stride_tricks.sliding_window_view(part, window, axis=0), axis=-1)
    first = np.arange(len(values)) // step - window // 2
    return np.asarray(medians[np.clip(first, 0, len(medians) - 1)])
