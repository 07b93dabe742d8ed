"""Measurements of a contact in the frame of one link: means over windows, without the observer's low-pass.

The observer's residual r follows the external part x by dr/dt = K (x - r). Over one step of length dt, with a
= exp(-K dt), the mean of x is (r1 - a r0) / (1 - a), whose noise is white: that of one sample. The external
wrench of each step is moved to the link's frame before it is averaged. A wrench through a fixed point is
linear in its force, so the mean of a window is a wrench through that point, however force and arm move.
Torques are averaged as what they differ from that wrench's prediction, which is noise at every instant.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Model, Motion, empty_motion
from contactsense.robots.jit.kernel import kernel
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.samples.contact_windows import ContactWindows


class LinkWindows(NamedTuple):
    """Means over W windows for a contact on one link."""

    wrench: np.ndarray
    """External wrench, axes and origin of the link, shape (W, 6) [N, Nm]."""
    torque: np.ndarray
    """External torque about each joint, as if the arm kept the posture of the window's middle, shape (W, n)
    [Nm]."""
    transform: np.ndarray
    """Wrench in the link's frame to base wrench, in the middle of each window, shape (W, 6, 6)."""
    screw: np.ndarray
    """Screws of the joints that carry the link, base frame, zero for others, shape (W, n, 6)."""


class _Residuals(NamedTuple):
    """N samples of a contact: posture and residuals, low-passed by the observers."""

    t: np.ndarray
    """Time [s], shape (N,)."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    base_wrench: np.ndarray
    """External base wrench, shape (N, 6) [N, Nm]."""
    joint_torque: np.ndarray
    """External joint torques, shape (N, n) [Nm]."""


def link_windows(
    model: Model,
    history: ContactHistory,
    windows: ContactWindows,
    bandwidth: float,
    body: int,
) -> LinkWindows:
    """Average the residuals of a contact in the frame of a body.

    Args:
        model: Kinematics.
        history: The contact.
        windows: Its windows.
        bandwidth: Cut-off of the observers [Hz].
        body: Body whose frame is used.
    """
    count, joints = len(windows.t), windows.q.shape[1]
    found = LinkWindows(
        np.zeros((count, 6)), np.zeros((count, joints)), np.zeros((count, 6, 6)), np.zeros((count, joints, 6))
    )
    residuals = _Residuals(
        history.t,
        np.ascontiguousarray(history.block.q),
        np.ascontiguousarray(history.base_wrench),
        np.ascontiguousarray(history.joint_torque),
    )
    motion, K = empty_motion(joints), 2.0 * math.pi * bandwidth
    _average(model, motion, residuals, K, windows.edges, body, np.zeros(joints), np.zeros(6), found)
    _add_prediction(model, motion, np.ascontiguousarray(windows.q), body, found)
    return found


@kernel
def _average(
    model: Model,
    motion: Motion,
    residuals: _Residuals,
    K: float,
    edges: np.ndarray,
    body: int,
    posture: np.ndarray,
    external: np.ndarray,
    out: LinkWindows,
) -> None:
    """Means of the wrench, and of the torques minus what it predicts; `posture` (n,) and `external` (6,) are
    scratch."""
    t, q, base_wrench, joint_torque = residuals
    wrench, torque = out.wrench, out.torque
    joints = q.shape[1]
    for w in range(edges.shape[0] - 1):
        total = t[edges[w + 1]] - t[edges[w]]
        for i in range(edges[w], edges[w + 1]):
            dt = t[i + 1] - t[i]
            a = math.exp(-K * dt)
            share = dt / total
            for j in range(joints):
                posture[j] = 0.5 * (q[i, j] + q[i + 1, j])
            forward_kinematics(model, posture, motion)
            R, o = motion.rotation[body], motion.origin[body]
            for k in range(6):
                external[k] = (base_wrench[i + 1, k] - a * base_wrench[i, k]) / (1.0 - a)
            fx, fy, fz = external[0], external[1], external[2]
            mx = external[3] - (o[1] * fz - o[2] * fy)
            my = external[4] - (o[2] * fx - o[0] * fz)
            mz = external[5] - (o[0] * fy - o[1] * fx)
            for k in range(3):
                wrench[w, k] += share * (R[0, k] * fx + R[1, k] * fy + R[2, k] * fz)
                wrench[w, 3 + k] += share * (R[0, k] * mx + R[1, k] * my + R[2, k] * mz)
            for j in range(joints):
                value = (joint_torque[i + 1, j] - a * joint_torque[i, j]) / (1.0 - a)
                if j < body:
                    for k in range(6):
                        value -= motion.screw[j, k] * external[k]
                torque[w, j] += share * value


@kernel
def _add_prediction(model: Model, motion: Motion, middle: np.ndarray, body: int, out: LinkWindows) -> None:
    """Fill transforms and screws in the posture in the middle of each window, and add the torques that the
    mean wrench predicts there."""
    wrench, torque, transform, screw = out
    joints = middle.shape[1]
    for w in range(middle.shape[0]):
        forward_kinematics(model, middle[w], motion)
        R, o = motion.rotation[body], motion.origin[body]
        for i in range(3):
            for k in range(3):
                transform[w, i, k] = transform[w, 3 + i, 3 + k] = R[i, k]
        for k in range(3):
            transform[w, 3, k] = o[1] * R[2, k] - o[2] * R[1, k]
            transform[w, 4, k] = o[2] * R[0, k] - o[0] * R[2, k]
            transform[w, 5, k] = o[0] * R[1, k] - o[1] * R[0, k]
        for j in range(min(body, joints)):
            for k in range(6):
                screw[w, j, k] = motion.screw[j, k]
            for i in range(6):
                for k in range(6):
                    torque[w, j] += screw[w, j, i] * transform[w, i, k] * wrench[w, k]
