"""Where a contact is now that may slide: the mean over a window lags behind it.

The place x of a window is where the contact was at the mean age a of its content, both weighted by force. The
means over nested windows share their noise: what is newer in the shorter one of two is independent of the
longer one. With F the normal force and V the variance of the moment of a window's mean, each window i and the
next longer one j thus give an independent measurement of the place p now and of a constant velocity v,

    F_i x_i - F_j x_j = (F_i - F_j) p - (F_i a_i - F_j a_j) v,    of variance V_i - V_j,

the longest one alone with F_j = V_j = 0. Beforehand, the contact holds its place with probability 1 - q, or
slides. What slides over the arm drags it along (Coulomb): the tangential force has the direction of its
velocity. So the component of the velocity along that force is positive, as the absolute value of a normal
variable, and the component across it is zero, both as far as the normal is known: a tangential force of r
times the normal one has a direction of weight r^2 / (r^2 + e^2), with e the error of the normal. Without a
tangential force both components are normally distributed about zero. With m_k and s_k mean and variance of
the component k, and L_k its inverse variance, prior included, the odds of sliding are

    q / (1 - q) * prod_k exp(1/2 L_k v_k^2 - 1/2 m_k^2 / s_k) / sqrt(s_k L_k).

The place moves by what this regression finds, times the probability that the contact slides. The variance
that the regression leaves and that between both cases add to its covariance. So the region of a contact that
may slide unnoticed contains where it may be, and that of one which has long held its place is hardly wider.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, add, dot, norm, rotate, scale, tangents, vector
from contactsense.tracking.contact_track import SLIDE, WINDOWS, ContactTrack
from contactsense.tracking.contact_tracker import POSITION_TOLERANCE

_PROBABILITY = 0.5
"""That a contact slides, before any window tells; of one in the phase `SLIDE` it is 1."""
_SPEED = 0.03
"""Standard deviation of the velocity of a sliding contact along each tangent, its direction unknown [m/s]: a
few centimetres a second, as hands and objects slide along an arm."""
NORMAL_ERROR = 0.15
"""Of the direction of the normal [rad]: how far that of a primitive usually is from that of the link."""
_MAX_SHIFT = 0.03
"""Largest shift of a point [m]: along a tangent, farther ones leave a curved link. The rest adds to the
covariance."""
_JUMP, _JUMP_SPEED = 0.01, 0.13
"""A shift that is both farther than this [m] and faster than three standard deviations of the speed [m/s] is
no slide, but another contact that a longer window still contains: nothing is shifted."""
_MAX_LOG_ODDS = 50.0
"""Bound that keeps the exponential finite."""


class _Slide(NamedTuple):
    """Where the contact is now if it slides, from the place of the window in use."""

    x: float
    y: float
    """Shift along the tangents [m]."""
    variance: float
    """What its variance exceeds that of the window's place by [m^2]."""
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
    normal = vector(track.last_normal)
    t1, t2 = tangents(normal)
    slide, R = _regress(track, _velocity_prior(track, t1, t2)), motion.rotation[body]
    probability = slide.probability
    step = scale(probability, add(scale(slide.x, t1), scale(slide.y, t2)))
    distance = norm(step)
    if distance > max(_JUMP, _JUMP_SPEED * track.windows[status.window].age):
        distance = 0.0
    done = min(distance, _MAX_SHIFT)
    if done > 0.0:
        step = scale(done / distance, step)
        step_base = rotate(R, step)
        for k in range(3):
            point[k] += step[k]
            point_base[k] += step_base[k]
    # Of the mixture of holding and sliding.
    between = 0.5 * (1.0 - probability) * (slide.x * slide.x + slide.y * slide.y)
    variance = probability * (slide.variance + between) + 0.5 * (distance - done) ** 2
    n = rotate(R, normal)
    for i in range(3):
        covariance[i, i] += variance
        for k in range(3):
            covariance[i, k] -= variance * n[i] * n[k]


class _VelocityPrior(NamedTuple):
    """What the tangential force tells of the velocity of a contact that slides."""

    x: float
    y: float
    """Unit vector of its direction, along the tangents."""
    mean: float
    """Of the component along it [m/s]; across it, zero."""
    variance_along: float
    variance_across: float
    """[m^2/s^2]"""


@kernel
def _velocity_prior(track: ContactTrack, t1: Vector, t2: Vector) -> _VelocityPrior:
    """From the mean force of the window in use; t1 and t2 are the tangents."""
    status = track.status[0]
    index = 6 * status.last_body
    w, normal_force = track.mean[status.window], track.windows[status.window].normal_force
    force = (w[index], w[index + 1], w[index + 2])
    x, y = dot(force, t1), dot(force, t2)
    squared = x * x + y * y
    if not squared > 0.0:
        return _VelocityPrior(1.0, 0.0, 0.0, _SPEED * _SPEED, _SPEED * _SPEED)
    error = (NORMAL_ERROR * normal_force) ** 2
    known, unknown = squared / (squared + error), error / (squared + error)
    # Moments of the absolute value of a normal variable with the variance of both components together.
    mean = _SPEED * math.sqrt(known * 4.0 / math.pi)
    tangential = math.sqrt(squared)
    return _VelocityPrior(
        x / tangential,
        y / tangential,
        mean,
        (1.0 + known) * _SPEED * _SPEED - mean * mean,
        unknown * _SPEED * _SPEED,
    )


@kernel
def _regress(track: ContactTrack, prior: _VelocityPrior) -> _Slide:
    """Place and velocity by weighted least squares from the windows."""
    status = track.status[0]
    used, slides = track.windows[status.window], status.phase == SLIDE
    # Sums of the normal equations for p and v, with places relative to that of the window in use.
    pp, pv, vv, px, py, vx, vy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    # Of the next longer window: variance, normal force, and age and place times that force.
    longer_variance, longer_force, longer_age, longer_x, longer_y = 0.0, 0.0, 0.0, 0.0, 0.0
    # A longer window than the one in use may reach back to before the slide; the next one is near enough.
    for i in range(min(status.window + 1, WINDOWS - 1) if slides else status.window, -1, -1):
        window = track.windows[i]
        F, variance = window.normal_force, 0.5 * (window.moment_xx + window.moment_yy)
        if not F < 0.0 or (longer_force < 0.0 and not variance > longer_variance):
            continue
        age, x, y = F * window.age, F * (window.x - used.x), F * (window.y - used.y)
        weight = 1.0 / (variance - longer_variance + (POSITION_TOLERANCE * F) ** 2)
        of_place, of_velocity = F - longer_force, longer_age - age
        pp += weight * of_place * of_place
        pv += weight * of_place * of_velocity
        vv += weight * of_velocity * of_velocity
        px += weight * of_place * (x - longer_x)
        py += weight * of_place * (y - longer_y)
        vx += weight * of_velocity * (x - longer_x)
        vy += weight * of_velocity * (y - longer_y)
        longer_variance, longer_force = variance, F
        longer_age, longer_x, longer_y = age, x, y
    of_windows = max(vv - pv * pv / pp, 0.0)
    of_x, of_y = vx - pv * px / pp, vy - pv * py / pp
    along, across = of_windows + 1.0 / prior.variance_along, of_windows + 1.0 / prior.variance_across
    v_along = (prior.x * of_x + prior.y * of_y + prior.mean / prior.variance_along) / along
    v_across = (prior.x * of_y - prior.y * of_x) / across
    log_odds = 0.5 * (along * v_along * v_along + across * v_across * v_across)
    log_odds -= 0.5 * prior.mean * prior.mean / prior.variance_along
    shrinkage = math.sqrt(prior.variance_along * along * prior.variance_across * across)
    odds = _PROBABILITY * math.exp(min(log_odds, _MAX_LOG_ODDS)) / shrinkage
    of_moment = 0.5 * (used.moment_xx + used.moment_yy)
    of_window = of_moment / used.normal_force**2 + POSITION_TOLERANCE * POSITION_TOLERANCE
    variance = 1.0 / pp + (pv / pp) ** 2 * 0.5 * (1.0 / along + 1.0 / across) - of_window
    velocity_x = prior.x * v_along - prior.y * v_across
    velocity_y = prior.y * v_along + prior.x * v_across
    return _Slide(
        (px - pv * velocity_x) / pp,
        (py - pv * velocity_y) / pp,
        max(variance, 0.0),
        1.0 if slides else odds / (odds + 1.0 - _PROBABILITY),
    )
