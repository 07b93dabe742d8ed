"""A contact that slides is ahead of where the observer and its means see it: by how much.

Each window's place is where the contact was some time ago, on average: its age. Of two windows that differ in
place the younger one, less the way from the older to it over the difference of their ages, times its own age,
is where a contact is now that keeps its velocity.
"""

import numpy as np

from contactsense.tracker import PHASE, SLIDE, WINDOW, WINDOWS, Track, tangents
from kinematics.model import Motion
from robots.compiled import kernel

_OLDER = 0.5
"""The older window must be older by this share of the younger one's age."""
_FARTHEST = 0.01
"""No contact is moved further [m]."""


@kernel
def lead(track: Track, motion: Motion, body: int, row: np.ndarray) -> None:
    """Move the place of an explanation to where a sliding contact is now.

    Args:
        track: After `contactsense.tracker.choose` and `live` for this sample.
        motion: Poses.
        body: Number of the body on which the explanation is; another one than before has no velocity yet.
        row: The explanation, see `contactsense.report`; its point is changed in place.
    """
    i = int(track.life[WINDOW])
    if track.life[PHASE] != SLIDE or int(track.place[0]) != body or i + 1 >= WINDOWS:
        return
    older = track.age[i + 1] - track.age[i]
    push = track.apart[i, 2]
    if older < _OLDER * track.age[i] or not push < 0.0 or not track.apart[i + 1, 2] < 0.0:
        return
    ahead = track.age[i] / older
    a = ahead * (track.apart[i, 0] - track.apart[i + 1, 0])
    b = ahead * (track.apart[i, 1] - track.apart[i + 1, 1])
    square = a * a + b * b
    noise = ahead * ahead * track.gain[i] * (track.spread[0] + track.spread[2]) / (push * push)
    if not 0.0 < square < _FARTHEST * _FARTHEST:
        return
    # As much of it as is not noise (W. James, C. Stein, 1961).
    share = max(0.0, 1.0 - noise / square)
    p = track.place
    t = tangents(p[4], p[5], p[6])
    R = motion.rotation[body]
    for k in range(3):
        row[4 + k] += share * (a * t[k] + b * t[3 + k])
    for k in range(3):
        step = 0.0
        for m in range(3):
            step += R[k, m] * (a * t[m] + b * t[3 + m])
        row[7 + k] += share * step
    # The way ahead is known no better than the velocity.
    for k in range(3):
        row[16 + 4 * k] += 0.5 * min(noise, square)
