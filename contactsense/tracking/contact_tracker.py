"""Contact tracker: averages the residuals while a contact keeps its position, and follows it when it moves.

The residuals of a contact are averaged over windows of growing length: the observer's own and five longer
ones, the last unbounded. Base wrenches are averaged in the frame of each body. As a moment is linear in the
force at a fixed point, the mean of many wrenches through one point is a wrench through that point, however
the force varies and the arm moves. The torque of a proximal joint minus the prediction of the base wrench,
and the torque of a distal joint, are zero-mean noise at every instant. So a window's mean is explained by a
contact just as one sample is, with a variance that decreases with the window's length: position and link
probability sharpen as long as the contact holds.

Which windows can be used is decided by Lepski's rule: up to the longest one whose position agrees with those
of all shorter windows to within their noise. A long window that clearly disagrees restarts from the longest
usable one: the contact has moved. Of the usable windows, the one with the least noise relative to its force
is explained: while a force rises, a mean over all of it has more noise and less force than the newest
residual.
"""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import Six, dot6
from contactsense.residuals.wrench_velocity_error import noise_share_in_average
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.vectors import Vector, cross, rotate, tangents, vector
from contactsense.sensors.usable_sensors import Usable
from contactsense.tracking.contact_track import HOLD, NEW, NONE, SLIDE, WINDOWS, ContactTrack, Window
from contactsense.tracking.torque_windows import present_magnitude, torque_difference
from contactsense.tracking.window_averages import WINDOW_GROWTH

AGREE, AGREE_HOLDING, DISAGREE = 1.5, 4.0, 9.0
"""Distance below which windows agree, the same for a holding contact, and distance above which they disagree,
as (x - d) / sqrt(2 d) of a chi-square variable x with d degrees of freedom. For the two of a position: x = 5,
10 and 20, which noise exceeds with probability 8e-2, 7e-3 and 5e-5."""
SHORT_WINDOWS = 3
"""Shorter windows are not restarted, as they forget soon enough. The difference of their positions is the
velocity of a sliding contact."""
POSITION_TOLERANCE = 1e-4
"""A position may change by this much without counting as moved: skin deforms, contact patches roll [m]."""
ENDING_SHARE = 0.25
"""A contact does not count as moved while its force in the newest window is less than this share of that in
the next one."""
NEW_TIME_CONSTANTS = 9.0
"""A contact is new for this many time constants of the observer; then it holds or slides."""
HOLD_TIME_CONSTANTS = 20.0
"""A sliding contact holds again when it has not moved for this many time constants."""


@kernel
def choose_window(
    torque_noise: tuple[np.ndarray, float],
    base_noise: tuple[np.ndarray, np.ndarray],
    track: ContactTrack,
    motion: Motion,
    usable: Usable,
    dt: float,
    bandwidth: float,
) -> bool:
    """Choose the window to use; returns whether the contact has moved.

    The windows are tested from the shortest to the longest, each against all shorter ones. One can be used if
    they all agree. One that clearly disagrees contains samples of another place, and begins anew as a copy of
    the longest that can be used; in between it is neither used nor restarted. If windows 0 to 3 agree, for
    example, and 4 disagrees with 0, then 4 becomes a copy of 3, and 3 is the longest that can be used.

    Without a base sensor windows are compared by the direction of their torques
    (`contactsense.tracking.torque_windows`), and the present magnitude of the force is stored.

    Args:
        torque_noise: Stated variance of each joint torque's noise in one sample, shape (n,) [Nm^2], and that
            of the stream in units of it (`contactsense.residuals.noise_scale`).
        base_noise: Covariance of white noise of the base wrench, see `contactsense.runtime.state.State`, and
            that of the newest residual due to the velocities' noise, which is a part of it, shape (6, 6).
        track: Changed in place: the chosen window, and windows that are restarted.
        motion: Poses.
        usable: Which residuals can be used. With a sensor within the arm, the magnitudes of the torques must
            agree, too: it measures the present force better than they do.
        dt: Time since the last sample [s].
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    has_base, _, link_sensors = usable
    status = track.status[0]
    # The newest residual alone does not show a sustained contact.
    status.window = 1 if status.sustained else 0
    status.magnitude = 1.0
    if status.last_body < 0:
        return False
    status.window = 0
    longest = 0
    # Without a base sensor: the longest one whose force has the magnitude of that in all shorter ones, too.
    longest_unchanged = 0
    slid = False
    joints = torque_noise[0].shape[0]
    agreement = AGREE_HOLDING if status.phase == HOLD else AGREE
    if has_base:
        _window_positions(track)
        _moment_covariances(base_noise, motion, track, bandwidth)
    for i in range(1, WINDOWS):
        max_distance, max_change = -1.0, -1.0
        for j in range(i):
            if has_base:
                max_distance = max(max_distance, _position_distance(track, i, j))
                continue
            difference = torque_difference(torque_noise, track, i, j)
            change = _chi_square_distance(difference.whole, joints)
            max_change = max(max_change, change)
            if link_sensors == 0:
                change = _chi_square_distance(difference.direction, max(joints - 1, 1))
            max_distance = max(max_distance, change)
        if max_change <= agreement and longest_unchanged == i - 1:
            longest_unchanged = i
        if max_distance > DISAGREE:
            slid = slid or (has_base and not _is_ending(track))
            if i < SHORT_WINDOWS:
                continue
            max_samples = WINDOW_GROWTH**longest / (2.0 * math.pi * bandwidth * max(dt, 1e-9))
            copy(track.mean[longest], track.mean[i])
            track.windows[i] = track.windows[longest]
            samples = min(max(track.windows[longest].samples, 1.0), max_samples) if longest > 0 else 1.0
            track.windows[i].samples = samples
        elif max_distance <= agreement and longest == i - 1:
            longest = i
    if has_base:
        status.window = _most_precise_window(track, longest)
    else:
        status.window = longest
        present = min(longest, longest_unchanged)
        status.magnitude = present_magnitude(torque_noise[0], track, longest, present)
    return slid


@kernel
def _is_ending(track: ContactTrack) -> bool:
    """Whether the force falls so fast that what the observers have not followed yet moves the position: in
    the newest window it is much less than in the next one."""
    # Both are negative.
    return bool(track.windows[0].normal_force > ENDING_SHARE * track.windows[1].normal_force)


@kernel
def _most_precise_window(track: ContactTrack, longest_window: int) -> int:
    """The window up to `longest_window`, all of which agree, whose mean gives the most precise position."""
    best = 0
    if track.windows[0].normal_force < 0.0:
        least = _position_variance(track.windows[0])
        for i in range(1, longest_window + 1):
            window = track.windows[i]
            if window.normal_force < 0.0 and _position_variance(window) <= least:
                best, least = i, _position_variance(window)
    return best


@kernel
def _position_variance(window: Window) -> float:
    """Of the position of a window, both tangents together, from noise [m^2]."""
    return float((window.moment_xx + window.moment_yy) / (window.normal_force * window.normal_force))


@kernel
def _window_positions(track: ContactTrack) -> None:
    """Intersection of each window's line of action with the tangent plane, and its normal force.

    With r = m - c x f the moment about the point c, shifting the contact by v in the tangent plane changes r
    by -v x f; the tangential part of r vanishes at v = (n x r) / (f . n), n being the normal.
    """
    cx, cy, cz = vector(track.last_point)
    nx, ny, nz = vector(track.last_normal)
    index = 6 * track.status[0].last_body
    (ax, ay, az), (bx, by, bz) = tangents((nx, ny, nz))
    for i in range(WINDOWS):
        w, window = track.mean[i], track.windows[i]
        fx, fy, fz = w[index], w[index + 1], w[index + 2]
        rx = w[index + 3] - cy * fz + cz * fy
        ry = w[index + 4] - cz * fx + cx * fz
        rz = w[index + 5] - cx * fy + cy * fx
        normal_force = fx * nx + fy * ny + fz * nz
        window.x = -(bx * rx + by * ry + bz * rz) / normal_force
        window.y = (ax * rx + ay * ry + az * rz) / normal_force
        window.normal_force = normal_force


@kernel
def _moment_covariances(
    base_noise: tuple[np.ndarray, np.ndarray], motion: Motion, track: ContactTrack, bandwidth: float
) -> None:
    """Covariance of (n x r) in the tangent plane, for the mean of each window; arguments as for
    `choose_window`. The velocities' noise averages out faster than that of the sensor."""
    p, normal, body = track.last_point, track.last_normal, track.status[0].last_body
    R, o = motion.rotation[body], motion.origin[body]
    cx = o[0] + R[0, 0] * p[0] + R[0, 1] * p[1] + R[0, 2] * p[2]
    cy = o[1] + R[1, 0] * p[0] + R[1, 1] * p[1] + R[1, 2] * p[2]
    cz = o[2] + R[2, 0] * p[0] + R[2, 1] * p[1] + R[2, 2] * p[2]
    along_a, along_b = tangents(vector(normal))
    a, b = _moment_row(R, along_a, (cx, cy, cz)), _moment_row(R, along_b, (cx, cy, cz))
    whole = _tangential_covariance(base_noise[0], a, b)
    of_velocities = _tangential_covariance(base_noise[1], a, b)
    newest = track.windows[0].variance_ratio
    for i in range(WINDOWS):
        window = track.windows[i]
        share = min(window.variance_ratio / newest, 1.0)
        less = share - noise_share_in_average(share, bandwidth)
        window.moment_xx = window.variance_ratio * whole[0] - less * of_velocities[0]
        window.moment_xy = window.variance_ratio * whole[1] - less * of_velocities[1]
        window.moment_yy = window.variance_ratio * whole[2] - less * of_velocities[2]


@kernel
def _tangential_covariance(covariance: np.ndarray, a: Six, b: Six) -> Vector:
    """Of n x r, as xx, xy, yy: along the tangents a and b it has the components -b . r and a . r."""
    xx, xy, yy = 0.0, 0.0, 0.0
    for i in range(6):
        Ca, Cb = dot6(covariance[i], a), dot6(covariance[i], b)
        xx += b[i] * Cb
        xy -= a[i] * Cb
        yy += a[i] * Ca
    return xx, xy, yy


@kernel
def _moment_row(R: np.ndarray, tangent: Vector, c: Vector) -> Six:
    """Row u with u . (f, m) = t . (m - c x f), t being the tangent in base axes."""
    t = rotate(R, tangent)
    return (*cross(c, t), *t)


@kernel
def _position_distance(track: ContactTrack, i: int, j: int) -> float:
    """Distance between the positions of two windows, in the unit of `AGREE`; the noise is that of the less
    precise one."""
    first, second = track.windows[i], track.windows[j]
    if not second.normal_force < 0.0 or not first.normal_force < 0.0:
        return 0.5 * (AGREE + DISAGREE)  # no force into the surface: the position is undefined
    noisier = first if _position_variance(first) > _position_variance(second) else second
    weight = 1.0 / (noisier.normal_force * noisier.normal_force)
    xx = weight * noisier.moment_xx + POSITION_TOLERANCE * POSITION_TOLERANCE
    xy = weight * noisier.moment_xy
    yy = weight * noisier.moment_yy + POSITION_TOLERANCE * POSITION_TOLERANCE
    dx, dy = first.x - second.x, first.y - second.y
    squared_distance = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
    return _chi_square_distance(squared_distance, 2)


@kernel
def _chi_square_distance(squares: float, freedom: int) -> float:
    """In the unit of `AGREE`, of a sum of squares that is a chi-square variable if windows agree."""
    return float((squares - freedom) / math.sqrt(2.0 * freedom))


@kernel
def update_phase(track: ContactTrack, slid: bool, dt: float, bandwidth: float) -> None:
    """Update the phase of the current contact; `slid`: result of `choose_window`."""
    status = track.status[0]
    time_constant = 1.0 / (2.0 * math.pi * bandwidth)
    if status.phase == NONE:
        status.phase = NEW
        status.age, status.time_since_slide = 0.0, 0.0
        return
    status.age += dt
    status.time_since_slide = 0.0 if slid else status.time_since_slide + dt
    if status.age < NEW_TIME_CONSTANTS * time_constant:
        return
    if status.phase == NEW:
        status.phase = HOLD
    if slid:
        status.phase = SLIDE
    elif status.phase == SLIDE and status.time_since_slide >= HOLD_TIME_CONSTANTS * time_constant:
        status.phase = HOLD
