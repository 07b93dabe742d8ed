"""How the residuals of a stretch of motion change with each parameter.

Every column but the links' is a difference of the observer's own residuals: nearly all parameters enter them
linearly, so that one large step is exact, and what the observer does is never written down twice. The links'
sixty columns come from the regressor in one pass.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.calibration.parameters import PER_JOINT, Entry, Group, moved
from contactsense.calibration.plant import Plant
from contactsense.calibration.residuals import GAP, residuals
from contactsense.calibration.stretch import Stretch
from contactsense.observer import empty_observer, observe_wrench
from kinematics.core import move
from kinematics.model import Model, Motion, empty_motion
from kinematics.regressor import PARAMETERS, arm_regressor
from robots.compiled import kernel

_SMALL: dict[Group, float] = {"tilt": 1e-5, "turn": 1e-5, "payload": 1e-3}
"""Steps for parameters that do not enter linearly, in units of their plausible size."""


@dataclass(frozen=True)
class Rows:
    """Residuals of one equation over one stretch, and their derivatives. N samples, k parameters."""

    channel: int
    """Number of the joint, or n + 0..5 for the base wrench."""
    residual: np.ndarray
    """Shape (N,) [Nm, or N and Nm]."""
    columns: np.ndarray
    """Numbers of the parameters that it holds, shape (k,)."""
    slope: np.ndarray
    """Derivatives of the residual, shape (N, k)."""
    moving: np.ndarray
    """Whether the joint has moved lately, so that its friction is known, shape (N,), bool."""
    dt: float
    """Time between rows [s]."""


def linearize(
    plant: Plant, stretch: Stretch, chosen: tuple[Entry, ...], bandwidth: float, every: int
) -> list[Rows]:
    """Residuals and derivatives of all equations over a stretch.

    Args:
        plant: Where to linearize.
        stretch: Contact-free motion.
        chosen: The parameters.
        bandwidth: Of the observer [Hz].
        every: Keep one row in so many: filtered residuals change slowly.
    """
    joints = stretch.q.shape[1]
    here = residuals(plant, stretch, bandwidth)
    keep = slice(_settled(stretch, bandwidth), None, every)
    slopes: list[tuple[int, np.ndarray, int | None]] = []
    done: set[Group] = set()
    for number, entry in enumerate(chosen):
        if entry.group == "links" or (stretch.reading is None and entry.in_base_only):
            continue
        if entry.group in PER_JOINT:
            if entry.group in done or stretch.torque is None:
                continue
            done.add(entry.group)
            slopes += _of_joints(plant, stretch, chosen, entry.group, bandwidth, here, keep)
        elif entry.group == "delay":
            h = 0.5 * float(np.median(np.diff(stretch.t)))
            ahead = residuals(moved(plant, [entry], np.array([h])), stretch, bandwidth)
            behind = residuals(moved(plant, [entry], np.array([-h])), stretch, bandwidth)
            slopes.append((number, ((ahead - behind) / (2.0 * h))[keep], None))
        else:
            h = entry.plausible * _SMALL.get(entry.group, 1.0)
            there = residuals(moved(plant, [entry], np.array([h])), stretch, bandwidth)
            slopes.append((number, ((there - here) / h)[keep], None))
    links = [(number, entry) for number, entry in enumerate(chosen) if entry.group == "links"]
    if links:
        slopes += _of_links(plant, stretch, links, bandwidth, keep)
    moving = _moving(stretch)[keep]
    dt = every * float(np.median(np.diff(stretch.t)))
    rows = []
    for channel in range(joints + 6):
        if (stretch.torque if channel < joints else stretch.reading) is None:
            continue
        own = [
            (number, slope[:, channel]) for number, slope, only in slopes if only is None or only == channel
        ]
        own = [(number, column) for number, column in own if np.any(column)]
        rows.append(
            Rows(
                channel,
                here[keep, channel],
                np.array([number for number, _ in own], dtype=np.int64),
                np.array([column for _, column in own]).reshape(len(own), -1).T.copy(),
                moving[:, channel] if channel < joints else np.ones(len(moving), dtype=bool),
                dt,
            )
        )
    return rows


def _settled(stretch: Stretch, bandwidth: float) -> int:
    """First sample at which the observer has settled after its start."""
    return int(np.searchsorted(stretch.t, stretch.t[0] + 5.0 / (2.0 * np.pi * bandwidth)))


def _of_joints(
    plant: Plant,
    stretch: Stretch,
    chosen: tuple[Entry, ...],
    group: Group,
    bandwidth: float,
    here: np.ndarray,
    keep: slice,
) -> list[tuple[int, np.ndarray, int | None]]:
    """One pass for all joints: each joint's own parameters are in its own equation only."""
    own = [(number, entry) for number, entry in enumerate(chosen) if entry.group == group]
    step = np.array([entry.plausible for _, entry in own])
    there = residuals(moved(plant, [entry for _, entry in own], step), stretch, bandwidth)
    found: list[tuple[int, np.ndarray, int | None]] = []
    for (number, entry), h in zip(own, step, strict=True):
        assert entry.joint is not None
        change = (there - here) / h
        if group == "gain":
            # The torque that the model asks for instead of the measured one: noise in a regressor would pull
            # the estimate towards zero.
            change = change - here / plant.gain[entry.joint]
        found.append((number, change[keep], entry.joint))
    return found


@kernel
def _observe_links(
    model: Model,
    motion: Motion,
    gravity: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    bandwidth: float,
    gap: float,
    weights: np.ndarray,
    out: np.ndarray,
) -> None:
    """Low-passed change of every equation per inertial parameter: the observer, fed with columns."""
    joints, links = q.shape[1], model.mass.shape[0]
    momentum, drift = np.empty((joints + 6, links, 10)), np.empty((joints + 6, links, 10))
    size = momentum.size
    state_h, state_d, state_r = np.zeros(size), np.zeros(size), np.zeros(size)
    scratch = np.empty(3)
    for i in range(t.shape[0]):
        dt = 0.0 if i == 0 else t[i] - t[i - 1]
        if dt > gap:
            dt = 0.0
        move(model, q[i], qd[i], gravity, motion)
        arm_regressor(
            model, motion, gravity, momentum[:joints], drift[:joints], momentum[joints:], drift[joints:],
            scratch,
        )  # fmt: skip
        for j in range(joints):
            momentum[j] *= weights[0]
            for k in range(links):
                for c in range(10):
                    drift[j, k, c] = weights[0] * drift[j, k, c]
        forget = np.exp(-2.0 * np.pi * bandwidth * dt)
        flat_h, flat_d = momentum.reshape(size), drift.reshape(size)
        for e in range(size):
            if dt > 0.0:
                external = (flat_h[e] - state_h[e]) / dt - 0.5 * (flat_d[e] + state_d[e])
                state_r[e] += (1.0 - forget) * (external - state_r[e])
            else:
                state_r[e] = 0.0
            state_h[e] = flat_h[e]
            state_d[e] = flat_d[e]
        out[i] = state_r.reshape(joints + 6, links, 10)
