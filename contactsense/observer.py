"""Momentum observer: external joint torques and external base wrench without accelerations (theory, section
2).

Joints and base obey equations of one shape, dh/dt = drift + external, with h = s_j . H_j for a joint and h =
H_0 for the base. One first-order observer serves both, with one gain, so that their residuals keep the same
phase.

Between two samples the mean of the external part is what the change of h leaves over beside the drift's mean:
e = (h1 - h0) / dt - (drift0 + drift1) / 2. The residual follows it as r <- a r + (1 - a) e with a = exp(-2 pi
f dt): exact for a constant external part, stable for every dt, and indifferent to lost samples and jitter.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.drive import Drive, friction_torque, unexplained
from kinematics.core import dot6
from kinematics.model import Model, Motion
from robots.compiled import kernel


class Observer(NamedTuple):
    """State of one group of equations: n joints, or the six components of a force/torque sensor."""

    momentum: np.ndarray
    """h at the last sample, shape (k,) [Nms for joints; Ns and Nms for a sensor]."""
    drift: np.ndarray
    """Known part of dh/dt at the last sample, shape (k,) [Nm; N and Nm]."""
    residual: np.ndarray
    """Low-passed external part, shape (k,): s_j . w of contacts beyond each joint [Nm], or the wrench w [N,
    Nm]."""


def empty_observer(size: int) -> Observer:
    """State before the first sample, for that many equations."""
    return Observer(np.zeros(size), np.zeros(size), np.zeros(size))


def noise_gain(bandwidth: float, dt: float) -> float:
    """Variance of the residual over that of white noise in the measurement, at a steady sample time dt
    [s]."""
    return -math.expm1(-2.0 * math.pi * bandwidth * dt) / 2.0


@kernel
def _advance(state, i, momentum, drift, dt, forget):  # type: ignore[no-untyped-def]
    """One equation's step; dt = 0 starts it anew."""
    if dt > 0.0:
        external = (momentum - state.momentum[i]) / dt - 0.5 * (drift + state.drift[i])
        state.residual[i] += (1.0 - forget) * (external - state.residual[i])
    else:
        state.residual[i] = 0.0
    state.momentum[i] = momentum
    state.drift[i] = drift


@kernel
def observe_joints(
    model: Model,
    drive: Drive,
    motion: Motion,
    qd: np.ndarray,
    torque: np.ndarray,
    dt: float,
    bandwidth: float,
    state: Observer,
    spread: np.ndarray,
) -> None:
    """Advance the joints' residuals by one sample.

    Args:
        model, motion: The arm, and `kinematics.core.move` done for this sample.
        drive: What the torque signal contains.
        qd: Joint velocities, shape (n,) [rad/s].
        torque: Torque that each actuator applies, shape (n,) [Nm].
        dt: Time since the last sample [s]; 0 starts anew.
        bandwidth: Cut-off frequency [Hz].
        state: Changed in place, n equations.
        spread: Changed in place: standard deviation of what model and friction leave of each residual, shape
            (n,) [Nm].
    """
    forget = math.exp(-2.0 * math.pi * bandwidth * dt)
    for j in range(qd.shape[0]):
        s, H = motion.screw[j], motion.momentum[j + 1]
        weight = dot6(s, motion.gravity[j + 1])
        h = drive.inertia * (dot6(s, H) + model.rotor_inertia[j] * qd[j])
        known = drive.inertia * dot6(motion.screw_rate[j], H) + drive.gravity * weight
        taken = drive.bias[j] + friction_torque(drive, j, qd[j], weight)
        _advance(state, j, h, known + torque[j] - taken, dt, forget)
        left = unexplained(drive, j, qd[j])
        # A lasting error passes the filter as the residual itself does.
        spread[j] = left + forget * (spread[j] - left) if dt > 0.0 else left


@kernel
def observe_wrench(
    momentum: np.ndarray,
    gravity: np.ndarray,
    wrench: np.ndarray,
    dt: float,
    bandwidth: float,
    state: Observer,
) -> None:
    """Advance the residual of a force/torque sensor by one sample.

    Args:
        momentum: Linear and angular momentum of all that the sensor carries, about the base origin, shape
            (6,).
        gravity: Gravity wrench on that, shape (6,) [N, Nm].
        wrench: Wrench of that on the sensor, shape (6,) [N, Nm].
        dt: Time since the last sample [s]; 0 starts anew.
        bandwidth: Cut-off frequency [Hz].
        state: Changed in place, six equations.
    """
    forget = math.exp(-2.0 * math.pi * bandwidth * dt)
    for i in range(6):
        _advance(state, i, momentum[i], gravity[i] - wrench[i], dt, forget)
