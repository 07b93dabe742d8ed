"""The compiled functions that Python calls, once per sample or once per batch; each opens a `Workspace`
first."""

import math

import numpy as np

from contactsense.arm import Arm
from contactsense.equations import difference
from contactsense.fit import judge
from contactsense.follower import QUIET
from contactsense.memory import Memory
from contactsense.observer import GAIN
from contactsense.pipeline import energy_of_nothing, explain, follow, follow_unknown, present, rest
from contactsense.report import report
from contactsense.slide import lead
from contactsense.tracker import NONE, PHASE, WINDOW, average, choose, forget, live
from contactsense.workspace import unfold
from robots.compiled import kernel
from robots.grid import Grids
from robots.uncounted import uncounted


@kernel
def finite(vector: np.ndarray) -> bool:
    """Whether all numbers of a vector are finite; NumPy takes ten times as long over six of them."""
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not math.isfinite(value):
            return False
    return True


@kernel
def step(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int],
    skin: Grids,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    steps: tuple[float, float, float, float, float],
    dt: float,
    bandwidth: float,
    matched: tuple[bool, bool],
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    gate: bool,
    onset: float,
    release: float,
    rows: np.ndarray,
) -> int:
    """One sample of a live stream: `follow`, and while a contact is on, `explain` what is averaged of it.

    Args:
        floats, integers, sizes, skin: The workspace and the skin.
        q, qd, torque, base_wrench, wrist_wrench, steps, bandwidth, matched: As for `follow`.
        dt: Time since the last sample [s], 0 for the first.
        has_base, has_torque, has_wrist, gate: As for `explain`.
        onset, release: Energies of "nothing touches" at which a contact begins and ends.
        rows: Filled with the explanations.

    Returns:
        Number of explanations in `rows`, 0 where a contact has none; -1 where nothing touches, -2 where no
        sensor can be used.
    """
    arm, memory = unfold(floats, integers, sizes)
    q, qd, torque = uncounted(q), uncounted(qd), uncounted(torque)
    base_wrench, wrist_wrench, rows = uncounted(base_wrench), uncounted(wrist_wrench), uncounted(rows)
    track = memory.track
    follow(arm, memory, q, qd, torque, base_wrench, wrist_wrench, steps, dt, bandwidth, matched)
    if not (has_base or has_torque):
        forget(track)
        return -2
    # A sensor that has missed a sample passes a little more of its noise: the noisiest counts.
    scale = 0.0
    if has_base:
        scale = max(scale, memory.base.clock[GAIN])
    if has_torque:
        scale = max(scale, memory.joints.clock[GAIN])
    if has_wrist:
        scale = max(scale, memory.wrist.clock[GAIN])
    nothing = energy_of_nothing(arm, memory, has_base, has_torque, has_wrist, scale)
    judge(arm, memory, scale)
    if nothing <= (onset if track.life[PHASE] == NONE else release):
        forget(track)
        follow_unknown(arm, memory, has_base, has_torque, scale, bandwidth)
        return -1
    memory.follower.clock[QUIET] = 0.0
    sensors = 1.0 * has_base + 2.0 * has_torque + 4.0 * has_wrist + 8.0 * matched[0] + 16.0 * matched[1]
    average(
        track,
        memory.base,
        memory.match,
        memory.joints,
        memory.wrist_match,
        memory.wrist,
        scale,
        sensors,
        dt,
        bandwidth,
    )
    moved = choose(arm.sensors, track, memory.motion, has_base, dt, bandwidth)
    live(track, moved, dt, bandwidth)
    window = int(track.life[WINDOW])
    if window > 0:
        _present_mean(memory, window, matched)
    count, _ = explain(arm, memory, has_base, has_torque, has_wrist, track.gain[window], gate, -1.0)
    listed: int = report(arm, memory, skin, count, rows)
    if listed > 0:
        if has_base:
            lead(track, memory.motion, arm.sensors.depth[int(rows[0, 0])], rows[0])
            if window > 0:
                _bring_up_to_date(arm, memory, window, rows[:listed])
        _remember(arm, memory, rows[0])
    return listed


@kernel
def _present_mean(memory: Memory, window: int, matched: tuple[bool, bool]) -> None:
    """Put a window's mean in the place of the observers' residuals."""
    n = memory.torque.shape[0]
    mean = memory.track.mean[window]
    a = 6 * (n + 1)
    b = a + n
    c = b + n
    present(memory, mean[:a], mean[a:b], mean[b:c], mean[c : c + 6], mean[c + 6 :], matched)


@kernel
def _remember(arm: Arm, memory: Memory, row: np.ndarray) -> None:
    """The place of the best explanation, for the next sample."""
    body = arm.sensors.depth[int(row[0])]
    R = memory.motion.rotation[body]
    place = memory.track.place
    place[0] = body
    for i in range(3):
        place[1 + i] = row[4 + i]
        place[4 + i] = R[0, i] * row[10] + R[1, i] * row[11] + R[2, i] * row[12]


@kernel
def _bring_up_to_date(arm: Arm, memory: Memory, window: int, rows: np.ndarray) -> None:
    """Place and link come from the mean over a window; force, torsion and wrench are told as they are now."""
    track = memory.track
    change = memory.change
    for k in range(rows.shape[0]):
        row = rows[k]
        body = arm.sensors.depth[int(row[0])]
        difference(memory.motion, track.mean[0], track.mean[window], body, change)
        fx, fy, fz = change[0], change[1], change[2]
        cx, cy, cz = row[7], row[8], row[9]
        row[13] += fx
        row[14] += fy
        row[15] += fz
        row[3] += (
            row[10] * (change[3] - cy * fz + cz * fy)
            + row[11] * (change[4] - cz * fx + cx * fz)
            + row[12] * (change[5] - cx * fy + cy * fx)
        )
    wrench, covariance = memory.hypotheses.wrench, memory.hypotheses.covariance
    wider = track.gain[0] / track.gain[window]
    for link in range(wrench.shape[0]):
        difference(memory.motion, track.mean[0], track.mean[window], arm.sensors.depth[link], change)
        for i in range(6):
            wrench[link, i] += change[i]
            for j in range(6):
                covariance[link, i, j] *= wider


@kernel
def once(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int],
    skin: Grids,
    q: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    external: bool,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    gate: bool,
    threshold: float,
    rows: np.ndarray,
) -> tuple[int, float]:
    """One sample of an arm at rest: `rest` and `explain`. Returns as `step`."""
    arm, memory = unfold(floats, integers, sizes)
    rest(arm, memory, q, torque, base_wrench, wrist_wrench, external)
    count, nothing = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, threshold)
    return report(arm, memory, skin, count, rows), nothing


@kernel
def batch(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int],
    skin: Grids,
    q: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    external: bool,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    gate: bool,
    nothing: np.ndarray,
    link_probability: np.ndarray,
    best: np.ndarray,
    rows: np.ndarray,
) -> None:
    """`once` for N samples; the best explanation of each goes into a row of `best`, its first number -1 for
    none."""
    arm, memory = unfold(floats, integers, sizes)
    q, torque, rows, best = uncounted(q), uncounted(torque), uncounted(rows), uncounted(best)
    base_wrench, wrist_wrench = uncounted(base_wrench), uncounted(wrist_wrench)
    for i in range(q.shape[0]):
        rest(arm, memory, q[i], torque[i], base_wrench[i], wrist_wrench[i], external)
        count, nothing[i] = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, -1.0)
        link_probability[i] = memory.link_probability
        if report(arm, memory, skin, min(count, 1), rows) > 0:
            best[i] = rows[0]
        else:
            best[i] = 0.0
            best[i, 0] = -1.0
