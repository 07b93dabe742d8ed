"""Extrapolate a sliding contact: window means lag behind it.

The point of each window is where the contact was at the mean age of its content. From two windows with
different points follows the velocity; the newer point plus the velocity times its age is where a contact with
constant velocity is now.
"""

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import add, rotate, scale, tangents, vector
from contactsense.tracking.contact_track import SLIDE, WINDOWS, ContactTrack

_MIN_AGE_RATIO = 0.5
"""The age difference of the two windows must be at least this fraction of the newer one's age."""
_MAX_SHIFT = 0.01
"""Largest shift of a point; above, nothing is shifted [m]."""


@kernel
def extrapolate_sliding(
    track: ContactTrack,
    motion: Motion,
    body: int,
    point: np.ndarray,
    point_base: np.ndarray,
    covariance: np.ndarray,
) -> None:
    """Shift the point of a candidate to the present position of a sliding contact.

    Args:
        track: After `contactsense.tracking.contact_tracker.choose_window` and `update_phase` for this sample.
        motion: Poses.
        body: Index of the candidate's body; on another body than before the velocity is unknown.
        point, point_base: The candidate's point in the body's frame and in the base frame, shape (3,) [m];
            changed in place.
        covariance: Of the point, base axes, shape (3, 3) [m^2]; changed in place.
    """
    status = track.status[0]
    i = status.window
    if status.phase != SLIDE or status.last_body != body or i + 1 >= WINDOWS:
        return
    newer, older = track.windows[i], track.windows[i + 1]
    age_difference, normal_force = older.age - newer.age, newer.normal_force
    if age_difference < _MIN_AGE_RATIO * newer.age or not normal_force < 0.0 or not older.normal_force < 0.0:
        return
    lead = newer.age / age_difference
    a = lead * (newer.x - older.x)
    b = lead * (newer.y - older.y)
    squared_distance = a * a + b * b
    noise = (
        lead
        * lead
        * newer.variance_ratio
        * (track.moment_covariance[0] + track.moment_covariance[2])
        / (normal_force * normal_force)
    )
    if not 0.0 < squared_distance < _MAX_SHIFT * _MAX_SHIFT:
        return
    # Shrinkage by the noise (W. James, C. Stein, 1961).
    weight = max(0.0, 1.0 - noise / squared_distance)
    t1, t2 = tangents(vector(track.last_normal))
    step = scale(weight, add(scale(a, t1), scale(b, t2)))
    step_base = rotate(motion.rotation[body], step)
    for k in range(3):
        point[k] += step[k]
        point_base[k] += step_base[k]
    # The shift is as uncertain as the velocity.
    for k in range(3):
        covariance[k, k] += 0.5 * min(noise, squared_distance)
