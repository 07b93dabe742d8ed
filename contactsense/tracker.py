"""A contact over time: while it keeps its place its noise is averaged out, when it moves it is followed.

The residuals of one contact are averaged over windows of growing length, the observer's own and five longer
ones, the last without end. Base wrenches are averaged in the frame of each body. As a moment is linear in the
force at a fixed point, the mean of many wrenches through one point is a wrench through that point, however
the force varies and the arm moves; and what a joint that sees the contact has beyond the base wrench, like
what a joint beyond it has at all, is noise with mean zero at every instant. So the mean over a window
explains itself by a contact just as one sample does, with a variance that is smaller by the window's length:
place and link probability sharpen as long as the contact holds still.

Which windows can be trusted is Lepski's rule: up to the longest one whose place agrees with those of all
shorter windows to within their noise. A long window that plainly disagrees starts again from that: the
contact has moved. Of those that can be trusted the one with the least noise for its force is explained: while
a force rises, a mean over all of it has more noise and less force than the newest residual.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.isolation import Sensors
from contactsense.observer import Observer
from kinematics.model import Motion
from robots.arrays import copy
from robots.compiled import kernel

WINDOWS = 6
"""Number of windows, the observer's own included."""
GROWTH = 3.0
"""Each window is so many times as long as the one before; the last has no end."""
AGREE, AGREE_HELD, PART = 1.5, 4.0, 9.0
"""Distance up to which windows agree, the same for a contact that holds, and from which on they part for
sure, as (x - d) / sqrt(2 d) of a chi-square variable x with d degrees of freedom: of the two of a place, x =
5, 10 and 20, which noise exceeds with probability 8e-2, 7e-3 and 5e-5."""
FORGETFUL = 3
"""Shorter windows forget by themselves soon enough: they do not start again. What lies between their places
is the velocity of a contact that slides."""
SLACK = 1e-4
"""A place may change by so much without counting as moved: skin gives, patches roll [m]."""
SETTLED = 9.0
"""A contact is new for so many time constants of the observer; then it holds or slides."""
CALM = 20.0
"""A contact holds again when it has not moved for so many time constants."""
NONE, NEW, HOLD, SLIDE = 0, 1, 2, 3
"""Phases of a contact."""


class Track(NamedTuple):
    """What is remembered of the contact that is on."""

    mean: np.ndarray
    """Averaged residuals, shape (WINDOWS, m): base wrench in the frame of each body, what torques have beyond
    it, torques, what the wrist sensor has beyond it, wrist wrench."""
    gain: np.ndarray
    """Variance of each window's mean over that of one sample's white noise, shape (WINDOWS,)."""
    shared: np.ndarray
    """Covariance of each mean with the observer's residual, in the same unit, shape (WINDOWS,)."""
    samples: np.ndarray
    """Samples in each window so far, shape (WINDOWS,)."""
    age: np.ndarray
    """How long ago what is in each window was, on average, the observer's lag included, shape (WINDOWS,)
    [s]."""
    place: np.ndarray
    """Where the last answer was: number of the body or -1, point and outward normal in its frame, shape (7,)
    [m]."""
    apart: np.ndarray
    """Scratch: place of each window in the tangent plane, and its push, shape (WINDOWS, 3)."""
    spread: np.ndarray
    """Scratch: covariance of the moment that a place leaves unexplained, tangents, as xx, xy, yy, shape
    (3,)."""
    life: np.ndarray
    """Phase, its number among all contacts, age [s], time since it last moved [s], the window in use, the
    sensors whose residuals are in the windows, whether the last sample was above the level at which
    contacts begin, shape (7,)."""


PHASE, NUMBER, AGE, CALM_FOR, WINDOW, SENSORS, ABOVE = 0, 1, 2, 3, 4, 5, 6
"""Places in `Track.life`."""


def empty_track(joints: int) -> Track:
    """Before the first contact."""
    return Track(
        mean=np.zeros((WINDOWS, 6 * (joints + 1) + 2 * joints + 12)),
        gain=np.zeros(WINDOWS),
        shared=np.zeros(WINDOWS),
        samples=np.zeros(WINDOWS),
        age=np.zeros(WINDOWS),
        place=np.full(7, -1.0),
        apart=np.zeros((WINDOWS, 3)),
        spread=np.zeros(3),
        life=np.zeros(7),
    )


@kernel
def forget(track: Track) -> None:
    """No contact; numbers go on."""
    track.life[PHASE] = NONE
    track.life[AGE] = 0.0
    track.life[CALM_FOR] = 0.0
    track.life[WINDOW] = 0.0
    track.life[ABOVE] = 0.0
    track.place[0] = -1.0


@kernel
def restart(track: Track) -> None:
    """Start all windows again from the observer's residual: what they have averaged was another contact."""
    for i in range(1, WINDOWS):
        copy(track.mean[0], track.mean[i])
        track.gain[i] = track.gain[0]
        track.shared[i] = track.shared[0]
        track.samples[i] = 1.0


@kernel
def _gather(
    out: np.ndarray, base: Observer, match: Observer, joints: Observer, wrist_match: Observer, wrist: Observer
) -> None:
    """The observers' residuals behind one another."""
    at = 0
    for part in (base.residual, match.residual, joints.residual, wrist_match.residual, wrist.residual):
        for i in range(part.shape[0]):
            out[at] = part[i]
            at += 1


@kernel
def average(
    track: Track,
    base: Observer,
    match: Observer,
    joints: Observer,
    wrist_match: Observer,
    wrist: Observer,
    gain: float,
    sensors: float,
    dt: float,
    bandwidth: float,
) -> None:
    """Take the observers' residuals into all windows; the first sample of a contact fills them, and so does
    one whose residuals are those of other sensors than before.

    Args:
        track: Changed in place.
        base, match, joints, wrist_match, wrist: The observers.
        gain: Variance of their residuals over that of one sample's white noise.
        sensors: A number that stands for the sensors that can be used and held against each other.
        dt: Time since the last sample [s].
        bandwidth: Cut-off of the observers [Hz].
    """
    fast = track.mean[0]
    _gather(fast, base, match, joints, wrist_match, wrist)
    track.gain[0] = gain
    track.shared[0] = gain
    K = 2.0 * math.pi * bandwidth
    track.age[0] = 1.0 / K
    afresh = track.life[PHASE] == NONE or track.life[SENSORS] != sensors
    track.life[SENSORS] = sensors
    decay = math.exp(-K * dt)
    length = GROWTH / K
    for i in range(1, WINDOWS):
        if afresh:
            copy(fast, track.mean[i])
            track.gain[i] = gain
            track.shared[i] = gain
            track.samples[i] = 1.0
            track.age[i] = track.age[0]
            continue
        track.samples[i] += 1.0
        share = 1.0 / track.samples[i]
        if i < WINDOWS - 1:
            share = max(share, min(dt / length, 1.0))
            length *= GROWTH
        mean = track.mean[i]
        for k in range(fast.shape[0]):
            mean[k] += share * (fast[k] - mean[k])
        # The observer's noise is correlated from sample to sample; so is what the window takes in.
        shared = decay * track.shared[i]
        keep = 1.0 - share
        track.gain[i] = keep * keep * track.gain[i] + 2.0 * share * keep * shared + share * share * gain
        track.shared[i] = keep * shared + share * gain
        track.age[i] = keep * (track.age[i] + dt) + share * track.age[0]


@kernel
def choose(
    sensors: Sensors, track: Track, motion: Motion, has_base: bool, dt: float, bandwidth: float
) -> bool:
    """Set the window that can be trusted; returns whether the contact has moved for sure.

    Args:
        sensors: Noise of one sample.
        track: Changed in place: `life`, and windows that start again.
        motion: Poses.
        has_base: Whether the base sensor's residual can be used. Without it windows agree as long as the
            torques do: while neither force nor arm changes.
        dt: Time since the last sample [s].
        bandwidth: Cut-off of the observers [Hz].
    """
    track.life[WINDOW] = 0.0
    if track.place[0] < 0.0:
        return False
    chosen = 0
    moved = False
    agree = AGREE_HELD if track.life[PHASE] == HOLD else AGREE
    if has_base:
        _spread(sensors, motion, track)
        for i in range(WINDOWS):
            _put(track, i)
    for i in range(1, WINDOWS):
        worst = -1.0
        for j in range(i):
            gap = _places_apart(track, i, j) if has_base else _torques_apart(sensors, track, i, j)
            worst = max(worst, gap)
        if worst > PART:
            moved = moved or has_base
            if i < FORGETFUL:
                continue
            reach = GROWTH**chosen / (2.0 * math.pi * bandwidth * max(dt, 1e-9))
            copy(track.mean[chosen], track.mean[i])
            track.gain[i] = track.gain[chosen]
            track.shared[i] = track.shared[chosen]
            track.age[i] = track.age[chosen]
            track.samples[i] = min(max(track.samples[chosen], 1.0), reach) if chosen > 0 else 1.0
            copy(track.apart[chosen], track.apart[i])
        elif worst <= agree and chosen == i - 1:
            chosen = i
    track.life[WINDOW] = _clearest(track, chosen) if has_base else chosen
    return moved


@kernel
def _clearest(track: Track, longest: int) -> int:
    """Of the windows up to `longest`, which all agree, that whose mean tells the place best."""
    best = 0
    if track.apart[0, 2] < 0.0:
        for i in range(1, longest + 1):
            push, most = track.apart[i, 2], track.apart[best, 2]
            if push < 0.0 and track.gain[i] * most * most <= track.gain[best] * push * push:
                best = i
    return best


@kernel
def tangents(nx: float, ny: float, nz: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors that span the plane across the unit vector n."""
    if abs(nx) < 0.6:
        length = math.sqrt(ny * ny + nz * nz)
        ax, ay, az = 0.0, nz / length, -ny / length
    else:
        length = math.sqrt(nx * nx + ny * ny)
        ax, ay, az = ny / length, -nx / length, 0.0
    return ax, ay, az, ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax


@kernel
def _put(track: Track, i: int) -> None:
    """Where window i's force line meets the tangent plane at the place, and its force into the surface.

    With r = m - c x f the moment about the place c, shifting the contact by v in the tangent plane changes r
    by -v x f; the part of r in that plane vanishes at v = (n x r) / (f . n), n being the normal.
    """
    p = track.place
    at = 6 * int(p[0])
    w = track.mean[i]
    fx, fy, fz = w[at], w[at + 1], w[at + 2]
    rx = w[at + 3] - p[2] * fz + p[3] * fy
    ry = w[at + 4] - p[3] * fx + p[1] * fz
    rz = w[at + 5] - p[1] * fy + p[2] * fx
    ax, ay, az, bx, by, bz = tangents(p[4], p[5], p[6])
    push = fx * p[4] + fy * p[5] + fz * p[6]
    track.apart[i, 0] = -(bx * rx + by * ry + bz * rz) / push
    track.apart[i, 1] = (ax * rx + ay * ry + az * rz) / push
    track.apart[i, 2] = push


@kernel
def _spread(sensors: Sensors, motion: Motion, track: Track) -> None:
    """Covariance of (n x r) in the tangent plane, for the noise of one sample of the base sensor."""
    p = track.place
    body = int(p[0])
    R, o = motion.rotation[body], motion.origin[body]
    cx = o[0] + R[0, 0] * p[1] + R[0, 1] * p[2] + R[0, 2] * p[3]
    cy = o[1] + R[1, 0] * p[1] + R[1, 1] * p[2] + R[1, 2] * p[3]
    cz = o[2] + R[2, 0] * p[1] + R[2, 1] * p[2] + R[2, 2] * p[3]
    t = tangents(p[4], p[5], p[6])
    C = sensors.base_covariance
    track.spread[:] = 0.0
    for k in range(3):
        u = _row(R, t, 1 if k < 2 else 0, cx, cy, cz)
        v = _row(R, t, 1 if k < 1 else 0, cx, cy, cz)
        total = 0.0
        for i in range(6):
            for j in range(6):
                total += u[i] * C[i, j] * v[j]
        track.spread[k] = total if k != 1 else -total


@kernel
def _row(
    R: np.ndarray,
    t: tuple[float, float, float, float, float, float],
    which: int,
    cx: float,
    cy: float,
    cz: float,
) -> tuple[float, float, float, float, float, float]:
    """u with u . (f, m) = tangent . (m - c x f); tangent 0 or 1 of `tangents`, turned to base axes."""
    x, y, z = (t[0], t[1], t[2]) if which == 0 else (t[3], t[4], t[5])
    tx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
    ty = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
    tz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
    return cy * tz - cz * ty, cz * tx - cx * tz, cx * ty - cy * tx, tx, ty, tz


@kernel
def _places_apart(track: Track, i: int, j: int) -> float:
    """How far the places of two windows are apart, as for `AGREE`; the one with more noise for its force
    bounds the noise."""
    push = track.apart[j, 2]
    if not push < 0.0 or not track.apart[i, 2] < 0.0:
        return 0.5 * (AGREE + PART)  # no push into the surface: the place means nothing
    share = max(track.gain[j] / (push * push), track.gain[i] / (track.apart[i, 2] * track.apart[i, 2]))
    xx = share * track.spread[0] + SLACK * SLACK
    xy = share * track.spread[1]
    yy = share * track.spread[2] + SLACK * SLACK
    dx, dy = track.apart[i, 0] - track.apart[j, 0], track.apart[i, 1] - track.apart[j, 1]
    square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
    return float(0.5 * (square - 2.0))


@kernel
def _torques_apart(sensors: Sensors, track: Track, i: int, j: int) -> float:
    """How far the torques of two windows are apart, as for `AGREE`."""
    n = sensors.torque_variance.shape[0]
    at = 6 * (n + 1) + n
    square = 0.0
    for k in range(n):
        d = track.mean[i, at + k] - track.mean[j, at + k]
        square += d * d / (sensors.torque_variance[k] * track.gain[j])
    return float((square - n) / math.sqrt(2.0 * n))


@kernel
def live(track: Track, moved: bool, dt: float, bandwidth: float) -> None:
    """Next phase of a contact that is on; `moved`: what `choose` returned."""
    life = track.life
    time_constant = 1.0 / (2.0 * math.pi * bandwidth)
    if life[PHASE] == NONE:
        life[PHASE] = NEW
        life[NUMBER] += 1.0
        life[AGE] = 0.0
        life[CALM_FOR] = 0.0
        return
    life[AGE] += dt
    life[CALM_FOR] = 0.0 if moved else life[CALM_FOR] + dt
    if life[AGE] < SETTLED * time_constant:
        return
    if life[PHASE] == NEW:
        life[PHASE] = HOLD
    if moved:
        life[PHASE] = SLIDE
    elif life[PHASE] == SLIDE and life[CALM_FOR] >= CALM * time_constant:
        life[PHASE] = HOLD
