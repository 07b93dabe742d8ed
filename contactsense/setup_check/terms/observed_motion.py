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
from contactsense.robots.jit.kernel import inlined_kernel
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
    """Means of the residuals over N intervals."""

    start: int
    """The first sample of the first."""
    stride: int
    """Samples of each."""
    residual: np.ndarray
    """Zeros at first, shape (N, E)."""


@inlined_kernel
def keep(kept: Kept, residual: np.ndarray, i: int) -> None:
    """Add the residuals at sample i, shape (E,), to the mean of its interval."""
    k = (i - kept.start) // kept.stride
    if i >= kept.start and k < kept.residual.shape[0]:
        mean, share = kept.residual[k], 1.0 / kept.stride
        for e in range(residual.shape[0]):
            mean[e] += share * residual[e]


def at_nodes(
    joints: int,
    equations: int,
    recordings: list[FreeMotion],
    instants: list[Instants],
    observe: Callable[[JointMotion, Equations, Kept], None],
) -> np.ndarray:
    """Averaged residuals at the five nodes about each of M instants, shape (M, 5, E).

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
        state = Equations(
            empty_observer(equations), np.zeros(equations), np.zeros(equations), empty_motion(joints),
            np.empty((6, PARAMETERS)), np.empty(3), np.zeros(3),
        )  # fmt: skip
        kept = Kept(at.start, at.stride, np.zeros((at.intervals, equations)))
        observe(JointMotion(t, part.q[at.motion], part.qd[at.motion]), state, kept)
        found.append(at.averages(kept.residual))
    return np.concatenate(found)


def node_times(recordings: list[FreeMotion], instants: list[Instants]) -> np.ndarray:
    """Times of the nodes after the instants, shape (M, 5) [s]."""
    pairs = zip(recordings, instants, strict=True)
    return np.concatenate([at.node_times(part.t) for part, at in pairs])
