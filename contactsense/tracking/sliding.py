"""Where a contact is now that may slide: the mean over a window lags behind it.

The place of each window is where the contact was at the mean age of its content. Two windows whose ages
differ by A and whose places by d thus measure a constant velocity v = d / A, with the variance u / A^2 along
each tangent, u being that of d. Beforehand, the contact holds its place with probability 1 - p, or slides
with a velocity whose components are normally distributed about zero with variance s. With r = s A^2 / u,

    odds of sliding:   p / (1 - p) * exp(1/2 |d|^2 / u * r / (1 + r)) / (1 + r),
    if it slides:      v = d / A * r / (1 + r), with the variance s / (1 + r).

The place moves by the age of its window times the mean of v over both cases, and that age squared times the
variance of v adds to its covariance. So the region of a contact that may slide unnoticed contains where it
may be, and that of one which has long held its place is hardly wider. Of all pairs with the window in use,
the one that measures the velocity best counts.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import add, dot, rotate, scale, tangents, vector
from contactsense.tracking.contact_track import SLIDE, WINDOWS, ContactTrack
from contactsense.tracking.contact_tracker import POSITION_TOLERANCE

_PROBABILITY = 0.5
"""That a contact slides, before any window tells; of one in the phase `SLIDE` it is 1."""
_SPEED = 0.03
"""Standard deviation of the velocity of a sliding contact along each tangent [m/s]: a few centimetres a
second, as hands and objects slide along an arm."""
_MAX_SHIFT = 0.01
"""Largest shift of a point; above, nothing is shifted [m]."""
_MAX_LOG_ODDS = 50.0
"""Bound that keeps the exponential finite."""


class _Velocity(NamedTuple):
    """Velocity along the tangents, if the contact slides."""

    x: float
    y: float
    """Mean [m/s]."""
    variance: float
    """Variance of each component [m^2/s^2]."""
    probability: float
    """That it slides."""


@kernel
def extrapolate_sliding(
    track: ContactTrack,
    motion: Motion,
    body: int,
    point: np.ndarray,
    point_base: np.ndarray,
    covariance: np.ndarray,
) -> None:
    """Move the point of a candidate to where the contact is now, as far as it slides.

    Args:
        track: After `contactsense.tracking.contact_tracker.choose_window` and `update_phase` for this sample.
        motion: Poses.
        body: Index of the candidate's body; on another body than before the velocity is unknown.
        point, point_base: The candidate's point in the body's frame and in the base frame, shape (3,) [m];
            changed in place.
        covariance: Of the point, base axes, shape (3, 3) [m^2]; changed in place.
    """
    status = track.status[0]
    if status.last_body != body or not track.windows[status.window].normal_force < 0.0:
        return
    velocity, R = _velocity(track), motion.rotation[body]
    age, probability = track.windows[status.window].age, velocity.probability
    normal = vector(track.last_normal)
    t1, t2 = tangents(normal)
    step = scale(age * probability, add(scale(velocity.x, t1), scale(velocity.y, t2)))
    if dot(step, step) < _MAX_SHIFT * _MAX_SHIFT:
        step_base = rotate(R, step)
        for k in range(3):
            point[k] += step[k]
            point_base[k] += step_base[k]
    # Of the mixture of holding and sliding.
    between = 0.5 * (1.0 - probability) * (velocity.x * velocity.x + velocity.y * velocity.y)
    variance = age * age * probability * (velocity.variance + between)
    n = rotate(R, normal)
    for i in range(3):
        covariance[i, i] += variance
        for k in range(3):
            covariance[i, k] -= variance * n[i] * n[k]


@kernel
def _velocity(track: ContactTrack) -> _Velocity:
    """What the windows tell of the velocity."""
    status, prior = track.status[0], _SPEED * _SPEED
    used, slides = track.windows[status.window], status.phase == SLIDE
    slid = 1.0 if slides else _PROBABILITY
    found = _Velocity(0.0, 0.0, prior, slid)
    # A longer window than the one in use may reach back to before the slide; the next one is near enough.
    for i in range(min(status.window + 2, WINDOWS) if slides else status.window):
        other = track.windows[i]
        apart = used.age - other.age
        if apart == 0.0 or not other.normal_force < 0.0:
            continue
        # Of two windows of which one contains the other.
        first, second = other.noise_to_force, used.noise_to_force
        noise = max(abs(first - second), min(first, second))
        noise *= 0.5 * (track.moment_covariance[0] + track.moment_covariance[2])
        noise += POSITION_TOLERANCE * POSITION_TOLERANCE
        ratio = prior * apart * apart / noise
        if prior / (1.0 + ratio) < found.variance:
            x, y = other.x - used.x, other.y - used.y
            share = ratio / (1.0 + ratio)
            log_odds = min(0.5 * (x * x + y * y) / noise * share, _MAX_LOG_ODDS)
            odds = slid * math.exp(log_odds) / (1.0 + ratio)
            found = _Velocity(
                share * x / apart, share * y / apart, prior / (1.0 + ratio), odds / (odds + 1.0 - slid)
            )
    return found
