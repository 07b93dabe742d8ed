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
from contactsense.drive import Drive
from contactsense.observer import Observer, advance, begin, empty_observer
from kinematics.core import move
from kinematics.model import Model, Motion, empty_motion
from kinematics.regressor import PARAMETERS, arm_regressor
from robots.arrays import copy
from robots.compiled import kernel

_SMALL: dict[Group, float] = {"tilt": 1e-5, "turn": 1e-5, "payload": 1e-3}
"""Steps for parameters that do not enter linearly, in units of their plausible size."""
_STANDSTILL = 0.5
_STANDSTILL_PATH = 2e-3
"""A joint that has moved less than this [rad] within so many seconds stands still."""


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
    keep = slice(settled(stretch, bandwidth), None, every)
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
                np.array([column for _, column in own]).reshape(len(own), len(here[keep])).T.copy(),
                moving[:, channel] if channel < joints else np.ones(len(moving), dtype=bool),
                dt,
            )
        )
    return rows


def settled(stretch: Stretch, bandwidth: float) -> int:
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
    drive: Drive,
    motion: Motion,
    gravity: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    bandwidth: float,
    gap: float,
    state: Observer,
    momentum: np.ndarray,
    drift: np.ndarray,
    scratch: np.ndarray,
    start: int,
    every: int,
    out: np.ndarray,
) -> None:
    """The observer, fed with the columns of the regressor in place of momenta and drifts."""
    joints = q.shape[1]
    row = 0
    for i in range(t.shape[0]):
        dt = 0.0 if i == 0 else t[i] - t[i - 1]
        step = begin(state, 0.0 if dt > gap else dt, bandwidth)
        move(model, q[i], qd[i], gravity, motion)
        arm_regressor(
            model, motion, gravity, drive.gravity, drive.inertia,
            momentum[:joints], drift[:joints], momentum[joints:], drift[joints:], scratch,
        )  # fmt: skip
        e = 0
        for r in range(momentum.shape[0]):
            for k in range(momentum.shape[1]):
                for c in range(momentum.shape[2]):
                    advance(state, e, momentum[r, k, c], drift[r, k, c], step)
                    e += 1
        if i >= start and (i - start) % every == 0:
            copy(state.residual, out[row])
            row += 1


def _of_links(
    plant: Plant, stretch: Stretch, links: list[tuple[int, Entry]], bandwidth: float, keep: slice
) -> list[tuple[int, np.ndarray, int | None]]:
    """Columns of all links' inertial parameters, in one pass."""
    joints = stretch.q.shape[1]
    shape = (joints + 6, joints + 1, PARAMETERS)
    rows = len(range(*keep.indices(len(stretch.t))))
    out = np.empty((rows, int(np.prod(shape))))
    _observe_links(
        plant.model, plant.drive, empty_motion(joints), plant.gravity, stretch.t, stretch.q, stretch.qd,
        bandwidth, GAP, empty_observer(out.shape[1]), np.empty(shape), np.empty(shape), np.empty(3),
        keep.start, keep.step, out,
    )  # fmt: skip
    columns = out.reshape(rows, *shape)
    return [(number, columns[:, :, entry.index[0], entry.index[1]], None) for number, entry in links]


def _moving(stretch: Stretch) -> np.ndarray:
    """Whether each joint has moved within the last half second, shape (N, n), bool.

    A joint that stands still holds any torque up to Coulomb friction: its samples say nothing.
    """
    ago = np.searchsorted(stretch.t, stretch.t - _STANDSTILL)
    path = np.vstack((np.zeros(stretch.q.shape[1]), np.cumsum(np.abs(np.diff(stretch.q, axis=0)), axis=0)))
    return np.asarray(path - path[ago] > _STANDSTILL_PATH)
