"""Recordings followed by the momentum observer, for any number of equations: what `joint_terms` and
`load_terms` share."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import JointMotion
from contactsense.kinematics.model import Motion, empty_motion
from contactsense.kinematics.regressor import PARAMETERS
from contactsense.residuals.momentum_observer import MomentumObserver, empty_observer
from contactsense.setup_check.terms.instants import Instants


class Equations(NamedTuple):
    """The observer's state for E equations, and what the kernels overwrite at each sample."""

    observer: MomentumObserver
    momentum: np.ndarray
    """Of each equation, shape (E,)."""
    drift: np.ndarray
    """The known part of its time derivative, shape (E,)."""
    motion: Motion
    """Kinematics of the arm."""
    regressor: np.ndarray
    """Momentum of one body per inertial parameter, shape (6, 10)."""
    scratch: np.ndarray
    """Shape (3,)."""
    weightless: np.ndarray
    """A gravity of zero, shape (3,)."""


class Kept(NamedTuple):
    """The samples whose residuals are kept."""

    start: int
    """The first of them."""
    stride: int
    """Samples from one to the next."""
    residual: np.ndarray
    """Filled, shape (N, E)."""


def at_nodes(
    joints: int,
    equations: int,
    recordings: list[FreeMotion],
    instants: list[Instants],
    observe: Callable[[JointMotion, Equations, Kept], None],
) -> np.ndarray:
    """Residuals at the five nodes about each of M instants, shape (M, 5, E).

    Args:
        joints: Number of joints.
        equations: Number of equations, E.
        recordings: Without gaps; their motion is used, their readings are not.
        instants: Of each recording.
        observe: Follows one recording.
    """
    found = []
    for part, at in zip(recordings, instants, strict=True):
        t = part.t[at.motion]
        start, end, stride = at.keep.indices(len(t))
        state = Equations(
            empty_observer(equations), np.zeros(equations), np.zeros(equations), empty_motion(joints),
            np.empty((6, PARAMETERS)), np.empty(3), np.zeros(3),
        )  # fmt: skip
        kept = Kept(start, stride, np.empty((len(range(start, end, stride)), equations)))
        observe(JointMotion(t, part.q[at.motion], part.qd[at.motion]), state, kept)
        found.append(kept.residual[at.nodes])
    return np.concatenate(found)


def node_times(recordings: list[FreeMotion], instants: list[Instants]) -> np.ndarray:
    """Times of the nodes after the instants, shape (M, 5) [s]."""
    pairs = zip(recordings, instants, strict=True)
    return np.concatenate([at.node_times(part.t) for part, at in pairs])
