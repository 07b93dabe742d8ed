"""What is not known of sensors and masses is followed while nothing touches, and kept while something does.

Biases of the base sensor and of the joint torques wander; masses are known to a few per cent. All of them
enter the observers' residuals linearly, so a Kalman filter follows them: r = Phi e + noise, e being by how
much they are off. The columns of Phi for the masses are the residuals of the same first-order filter, fed
with the momenta and weights of single links (theory, section 2). The filter learns from residuals of an arm
that nothing touches only. In a contact it waits; what it does not know meanwhile, Phi P Phi^T, widens the
covariance of the residuals: a contact is told from what the model may get wrong.

Biases are random walks whose variance is such that in the end each is the average over a given time T of its
residual: sigma^2 dt / T^2 a second for white noise sigma in samples dt apart.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsense.drive import Drive
from contactsense.observer import Observer, advance, begin, empty_observer
from kinematics.core import dot6
from kinematics.model import Model, Motion
from robots.compiled import kernel

APART = 2.0
"""Time constants of the observer between two residuals that are learned from."""
PAUSE = 5.0
"""Time constants after a contact until learning goes on."""
LEAST = -0.5
"""No mass is more than halved at once."""
WAITED, QUIET, WEIGHS = 0, 1, 2
"""Places in `Follower.clock`."""


class Follower(NamedTuple):
    """State of the filter: 6 biases of the base sensor, n of the torques, n relative masses, N in all."""

    covariance: np.ndarray
    """Of what is not known, shape (N, N)."""
    bias: np.ndarray
    """Bias of the base wrench beyond the scene's, base axes, base origin, shape (6,) [N, Nm]."""
    weights: Observer
    """Columns of the masses: n + 6 equations (joints, then base) for each of n links."""
    base: np.ndarray
    """Covariance of the base wrench from what is not known, shape (6, 6)."""
    torque: np.ndarray
    """Variance of each torque from that, shape (n,)."""
    weighed: np.ndarray
    """Scratch: covariance of each equation's residual with the masses, shape (n + 6, n)."""
    row: np.ndarray
    """Scratch: one equation's slopes, shape (N,)."""
    image: np.ndarray
    """Scratch: the covariance times that, shape (N,)."""
    change: np.ndarray
    """Scratch: what a step changes, shape (N,)."""
    wrench: np.ndarray
    """Scratch: what it changes of base wrench and of momentum, shape (2, 6)."""
    clock: np.ndarray
    """Time since the last step and since the last contact [s]; 1 if masses are followed, shape (3,)."""


def empty_follower(joints: int) -> Follower:
    """Before the first sample, for that many joints; `restart` fills in what is not known."""
    size = 6 + 2 * joints
    return Follower(
        covariance=np.zeros((size, size)),
        bias=np.zeros(6),
        weights=empty_observer((joints + 6) * joints),
        base=np.zeros((6, 6)),
        torque=np.zeros(joints),
        weighed=np.zeros((joints + 6, joints)),
        row=np.zeros(size),
        image=np.zeros(size),
        change=np.zeros(size),
        wrench=np.zeros((2, 6)),
        clock=np.zeros(3),
    )


def restart(follower: Follower, inertia_error: float, base_weight: np.ndarray) -> None:
    """Forget all that was learned.

    Args:
        follower: Changed in place.
        inertia_error: How far each link's mass may be off, relative, standard deviation.
        base_weight: Gravity wrench on the base link, shape (6,) [N, Nm]; an error of it is a bias.
    """
    for array in (*follower[:2], *follower.weights, *follower[3:]):
        array[:] = 0.0
    off = inertia_error * base_weight
    follower.covariance[:6, :6] = np.outer(off, off)
    masses = np.arange(len(follower.row) - len(follower.torque), len(follower.row))
    follower.covariance[masses, masses] = inertia_error**2
    follower.clock[WEIGHS] = 1.0 if inertia_error > 0.0 else 0.0


@kernel
def watch(
    follower: Follower,
    drive: Drive,
    motion: Motion,
    base_variance: np.ndarray,
    torque_variance: np.ndarray,
    rate: float,
    dt: float,
    bandwidth: float,
) -> None:
    """One sample: the columns of the masses, the random walk of the biases, the covariance of the residuals.

    Args:
        follower: Changed in place.
        drive: What the torque signal contains.
        motion: `kinematics.core.move` done for this sample.
        base_variance: Covariance of the base sensor's noise in one sample, shape (6, 6).
        torque_variance: Variance of each torque's, shape (n,).
        rate: 1 / T, 0: biases are constant [1/s].
        dt: Time since the last sample [s]; 0 starts anew.
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    P, n = follower.covariance, torque_variance.shape[0]
    follower.clock[WAITED] += dt
    follower.clock[QUIET] += dt
    grown = (rate * dt) ** 2
    for i in range(6):
        P[i, i] += grown * base_variance[i, i]
    for j in range(n):
        P[6 + j, 6 + j] += grown * torque_variance[j]
    if follower.clock[WEIGHS] > 0.0:
        step = begin(follower.weights, dt, bandwidth)
        H, G = motion.momentum, motion.gravity
        for k in range(n):
            last = k + 2 > n
            # A joint feels the links beyond it only.
            for j in range(k + 1):
                s, v = motion.screw[j], motion.screw_rate[j]
                h, known = dot6(s, H[k + 1]), dot6(v, H[k + 1])
                weight = dot6(s, G[k + 1])
                if not last:
                    h -= dot6(s, H[k + 2])
                    known -= dot6(v, H[k + 2])
                    weight -= dot6(s, G[k + 2])
                h *= drive.inertia
                known = drive.inertia * known + drive.gravity * weight
                advance(follower.weights, (n + 6) * k + j, h, known, step)
            for i in range(6):
                h = H[k + 1, i] - (0.0 if last else H[k + 2, i])
                g = G[k + 1, i] - (0.0 if last else G[k + 2, i])
                advance(follower.weights, (n + 6) * k + n + i, h, g, step)
    _widen(follower, n)


@kernel
def _sign(n: int, equation: int) -> float:
    """Slope of an equation's residual by its own bias: of a torque 1, of the base wrench -1."""
    return 1.0 if equation < n else -1.0


@kernel
def _own(n: int, equation: int) -> int:
    """Place of an equation's own bias among all that is followed; joints' equations come first, then six."""
    return equation + 6 if equation < n else equation - n


@kernel
def _widen(follower: Follower, n: int) -> None:
    """Covariance of the residuals from what is not known: `base`, `torque`.

    With B the covariance of biases, C that of biases with masses, M that of masses, S the signs and R the
    columns of the masses: S B S + S C R + (S C R)^T + R^T M R = S B S + U R + R^T V with U = S C, V = U^T + M
    R.
    """
    P, base, torque, weighed = follower.covariance, follower.base, follower.torque, follower.weighed
    for a in range(6):
        for b in range(6):
            base[a, b] = P[a, b]
    for j in range(n):
        torque[j] = P[6 + j, 6 + j]
    if follower.clock[WEIGHS] == 0.0:
        return
    r, m = follower.weights.residual, n + 6
    for equation in range(m):
        own, sign = _own(n, equation), _sign(n, equation)
        for k in range(n):
            total = sign * P[own, m + k]
            for i in range(n):
                total += P[m + k, m + i] * r[m * i + equation]
            weighed[equation, k] = total
    for j in range(n):
        for k in range(n):
            torque[j] += r[m * k + j] * (P[6 + j, m + k] + weighed[j, k])
    for a in range(6):
        for b in range(a + 1):
            total = 0.0
            for k in range(n):
                total += r[m * k + n + a] * weighed[n + b, k] - P[a, m + k] * r[m * k + n + b]
            base[a, b] += total
            base[b, a] = base[a, b]


@kernel
def learn(
    follower: Follower,
    equation: int,
    n: int,
    residual: float,
    variance: float,
) -> None:
    """Kalman step for one equation's residual; `change` gathers what it changes of all that is followed."""
    P, row, image = follower.covariance, follower.row, follower.image
    size = row.shape[0]
    row[:] = 0.0
    row[_own(n, equation)] = _sign(n, equation)
    if follower.clock[WEIGHS] > 0.0:
        for k in range(n):
            row[n + 6 + k] = follower.weights.residual[(n + 6) * k + equation]
    spread = variance
    innovation = residual
    for i in range(size):
        image[i] = 0.0
        for k in range(size):
            image[i] += P[i, k] * row[k]
        spread += image[i] * row[i]
        innovation += row[i] * follower.change[i]
    for i in range(size):
        follower.change[i] -= image[i] * innovation / spread
        for k in range(size):
            P[i, k] -= image[i] * image[k] / spread


@kernel
def take_up(
    follower: Follower,
    model: Model,
    drive: Drive,
    motion: Motion,
    bandwidth: float,
    base: Observer,
    match: Observer,
    joints: Observer,
    wrist_match: Observer,
) -> None:
    """Put what was learned, `change`, into biases and masses, and the observers into the state that they
    would be in had it been known before.

    Args:
        follower: With `change`, which is used up.
        model, drive: Masses and torque biases, changed in place.
        motion: Of this sample.
        bandwidth: Cut-off frequency of the observers [Hz].
        base, match, joints, wrist_match: The observers, changed in place; see `contactsense.memory`.
    """
    x, n = follower.change, drive.bias.shape[0]
    m = n + 6
    K = 2.0 * math.pi * bandwidth
    dw, dh = follower.wrench[0], follower.wrench[1]
    for i in range(6):
        follower.bias[i] += x[i]
        dw[i], dh[i] = -x[i], 0.0
    weighs = follower.clock[WEIGHS] > 0.0
    columns, H = follower.weights.residual, motion.momentum
    if weighs:
        for k in range(n):
            x[m + k] = max(x[m + k], LEAST)
            model.mass[k + 1] *= 1.0 + x[m + k]
            for i in range(3):
                for j in range(3):
                    model.inertia[k + 1, i, j] *= 1.0 + x[m + k]
            for i in range(6):
                dw[i] += x[m + k] * columns[m * k + n + i]
                dh[i] += x[m + k] * (H[k + 1, i] - (H[k + 2, i] if k + 2 <= n else 0.0))
    for j in range(n):
        drive.bias[j] += x[6 + j]
        dt, dp = x[6 + j], 0.0
        if weighs:
            for k in range(n):
                dt += x[m + k] * columns[m * k + j]
            for k in range(j, n):
                own = dot6(motion.screw[j], H[k + 1])
                own -= dot6(motion.screw[j], H[k + 2]) if k + 2 <= n else 0.0
                dp += drive.inertia * x[m + k] * own
        _shift(joints, j, dt, dp, K)
        _shift(match, j, dt - dot6(motion.screw[j], dw), dp - dot6(motion.screw[j], dh), K)
    for i in range(6):
        _shift(wrist_match, i, -dw[i], -dh[i], K)
    for body in range(n + 1):
        R, o = motion.rotation[body], motion.origin[body]
        for i in range(3):
            force, moment = 0.0, 0.0
            impulse, spin = 0.0, 0.0
            for k in range(3):
                a, b = (k + 1) % 3, (k + 2) % 3
                force += R[k, i] * dw[k]
                moment += R[k, i] * (dw[3 + k] - o[a] * dw[b] + o[b] * dw[a])
                impulse += R[k, i] * dh[k]
                spin += R[k, i] * (dh[3 + k] - o[a] * dh[b] + o[b] * dh[a])
            _shift(base, 6 * body + i, force, impulse, K)
            _shift(base, 6 * body + 3 + i, moment, spin, K)
    x[:] = 0.0


@kernel
def _shift(state: Observer, i: int, residual: float, momentum: float, K: float) -> None:
    """Equation i as if the model had always been another one: with dr/dt small, drift changes by -r."""
    state.residual[i] += residual
    state.momentum[i] += momentum
    for k in range(3):
        state.past[k, i] += K * momentum - residual
