"""Touches on a real arm at rest, the touched link known: one measurement per touch."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsense.benchmarks.panda import DRIFT

LOADED = 3.0
"""A touch counts if some torque changes by more than this many standard deviations of the drift: in the
others the hand touches without load."""


class Touches(NamedTuple):
    """N touches of an arm with n joints."""

    name: tuple[str, ...]
    """Name of each file of the recordings."""
    link: np.ndarray
    """Index of the touched link, shape (N,)."""
    q: np.ndarray
    """Joint positions, shape (N, n) [rad]."""
    torque: np.ndarray
    """External torque of each actuator minus its mean without contact, shape (N, n) [Nm]."""

    @property
    def in_drifts(self) -> np.ndarray:
        """`torque` in standard deviations of the drift, shape (N, n)."""
        return np.asarray(self.torque / np.array(DRIFT))


def read(folder: Path) -> Touches:
    """The touches in FOLDER/franka_links.npz.

    Samples of a touch are not independent, so each touch is one measurement: the sample with the largest
    change in units of the drift, relative to the mean of the touch's own samples without contact.
    """
    with np.load(folder / "franka_links.npz") as data:
        q, torque, label, link, touch, names = (
            data[key] for key in ("q", "tau_ext", "label", "link", "touch", "names")
        )
    rows, changes = [], []
    for number in range(len(names)):
        own = touch == number
        baseline = torque[own & (label == 0)].mean(axis=0)
        touched = np.flatnonzero(own & (label == 1))
        change = torque[touched] - baseline
        largest = int(np.argmax(np.abs(change / np.array(DRIFT)).max(axis=1)))
        rows.append(touched[largest])
        changes.append(change[largest])
    return Touches(tuple(map(str, names)), link[rows], q[rows], np.array(changes))


def loaded(touches: Touches) -> Touches:
    """Those in which some torque stands out from the drift."""
    keep = np.abs(touches.in_drifts).max(axis=1) > LOADED
    return Touches(
        tuple(name for name, kept in zip(touches.name, keep, strict=True) if kept),
        touches.link[keep],
        touches.q[keep],
        touches.torque[keep],
    )


def last_joint_above(torque: np.ndarray, threshold: np.ndarray | float) -> np.ndarray:
    """The usual rule: the touched link is the one that the last joint above its threshold carries.

    Args:
        torque: External torques, shape (N, n) [Nm].
        threshold: One for all joints, or one per joint, shape (n,) [Nm].

    Returns:
        Index of the link, 0 if no joint is above, shape (N,).
    """
    above = np.abs(torque) > threshold
    return np.asarray(np.where(above, np.arange(1, torque.shape[1] + 1), 0).max(axis=1))
