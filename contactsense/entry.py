"""The compiled functions that Python calls, once per sample or once per batch; each opens a `Workspace`
first."""

import math

import numpy as np

from contactsense.arm import Arm
from contactsense.equations import difference
from contactsense.fit import judge
from contactsense.follower import QUIET
from contactsense.health import NOTHING, attend, trust
from contactsense.memory import Memory
from contactsense.pipeline import (
    energy_of_nothing,
    explain,
    follow,
    follow_unknown,
    present,
    residual_gain,
    rest,
    watch_rest,
)
from contactsense.report import report
from contactsense.slide import lead
from contactsense.stiction import forget_levels
from contactsense.stream import (
    BASE,
    DOUBT,
    MISFIT,
    REPEATED,
    RESTARTED,
    SCALE,
    SETTLES,
    STEP,
    TORQUE,
    TOUCHED,
    UNUSABLE,
    arrive,
    pace,
    put,
    sensor_number,
    sensors_of,
)
from contactsense.tracker import ABOVE, NONE, PHASE, WINDOW, average, choose, forget, live
from contactsense.unfold import unfold
from robots.arrays import copy
from robots.compiled import inlined_kernel, kernel
from robots.grid import Grids


@kernel
def listen(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int, int],
    bandwidth: float,
    t: float,
    given: int,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
) -> int:
    """One sample of a live stream: does anything touch?

    Where nothing does, what is not known of sensors and masses is learned from.

    Args:
        floats, integers, sizes: The workspace.
        bandwidth: Cut-off frequency of the observers [Hz].
        t: Time of the sample [s].
        given: Which sensors have a value in it, see `contactsense.stream.arrive`.
        q, qd, torque, base_wrench, wrist_wrench: The rest of it, see `contactsense.types.Sample`; anything
            for a sensor without a value.

    Returns:
        What is to be said of the sample, see `contactsense.stream`.
    """
    arm, memory = unfold(floats, integers, sizes)
    track, stream, health = memory.track, memory.stream, memory.health
    if not put(stream, q, qd, torque, base_wrench, wrist_wrench):
        return MISFIT
    said: int = arrive(stream, t, given, bandwidth)
    if said & (REPEATED | UNUSABLE):
        return said
    if said & RESTARTED:
        forget(track)
    follow(arm, memory, bandwidth)
    base_there, torque_there = stream.usable[BASE] > 0.0, stream.usable[TORQUE] > 0.0
    trust(health, stream.usable)
    has_base, has_torque, has_wrist = sensors_of(stream)
    if not (has_base or has_torque):
        forget(track)
        forget_levels(memory.stiction)
        return said | SETTLES
    scale = residual_gain(memory, (has_base, has_torque, has_wrist))
    stream.clock[SCALE] = scale
    levels = arm.levels[1 * has_base + 2 * has_torque + 4 * has_wrist, pace(stream)]
    nothing = energy_of_nothing(arm, memory, has_base, has_torque, has_wrist, scale)
    # A base sensor needs no help from joints that rub.
    if not has_base:
        nothing = max(nothing, watch_rest(arm, memory, scale, (levels[0], levels[1]), bandwidth))
    judge(arm, memory, scale)
    memory.fit[NOTHING] = nothing
    # What stands out in one sample only is a sensor's outlier.
    above, begins = not nothing <= levels[0], track.life[PHASE] == NONE
    touched = above and track.life[ABOVE] > 0.0 if begins else not nothing <= levels[1]
    if attend(health, memory.fit, touched, base_there, torque_there, stream.clock[STEP]):
        said |= DOUBT
    if touched:
        return said | TOUCHED
    forget(track)
    if above and begins:
        track.life[ABOVE] = 1.0
    else:
        follow_unknown(arm, memory, has_base, has_torque, scale, bandwidth)
    return said


@kernel
def pursue(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int, int],
    skin_values: np.ndarray,
    skin_start: np.ndarray,
    skin_shape: np.ndarray,
    skin_low: np.ndarray,
    skin_cell: float,
    bandwidth: float,
    gate: bool,
    rows: np.ndarray,
) -> int:
    """After `listen` has found that something touches: average the residuals and `explain` them.

    Args:
        floats, integers, sizes: The workspace.
        skin_values, skin_start, skin_shape, skin_low, skin_cell: The skin, see `robots.grid.Grids`; a named
            tuple would take longer to hand over.
        bandwidth: Cut-off frequency of the observers [Hz].
        gate: As for `explain`.
        rows: Filled with the explanations.

    Returns:
        Number of explanations in `rows`.
    """
    arm, memory = unfold(floats, integers, sizes)
    skin = Grids(skin_values, skin_start, skin_shape, skin_low, skin_cell)
    track, stream = memory.track, memory.stream
    dt = stream.clock[STEP]
    memory.follower.clock[QUIET] = 0.0
    average(
        track,
        memory.base,
        memory.match,
        memory.joints,
        memory.wrist_match,
        memory.wrist,
        stream.clock[SCALE],
        sensor_number(stream),
        dt,
        bandwidth,
    )
    has_base, has_torque, has_wrist = sensors_of(stream)
    moved = choose(arm.sensors, track, memory.motion, has_base, dt, bandwidth)
    live(track, moved, dt, bandwidth)
    window = int(track.life[WINDOW])
    if window > 0:
        _present_mean(memory, window)
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
def fits(vector: np.ndarray, size: int) -> bool:
    """Whether a vector has that many numbers, all finite; NumPy takes ten times as long over six of them."""
    if len(vector) != size:
        return False
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not math.isfinite(value):
            return False
    return True


@inlined_kernel
def _present_mean(memory: Memory, window: int) -> None:
    """Put a window's mean in the place of the observers' residuals."""
    n = memory.torque.shape[0]
    mean = memory.track.mean[window]
    a = 6 * (n + 1)
    b = a + n
    c = b + n
    present(memory, mean[:a], mean[a:b], mean[b:c], mean[c : c + 6], mean[c + 6 :])


@inlined_kernel
def _remember(arm: Arm, memory: Memory, row: np.ndarray) -> None:
    """The place of the best explanation, for the next sample."""
    body = arm.sensors.depth[int(row[0])]
    R = memory.motion.rotation[body]
    place = memory.track.place
    place[0] = body
    for i in range(3):
        place[1 + i] = row[4 + i]
        place[4 + i] = R[0, i] * row[10] + R[1, i] * row[11] + R[2, i] * row[12]


@inlined_kernel
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
    sizes: tuple[int, int, int, int, int],
    skin_values: np.ndarray,
    skin_start: np.ndarray,
    skin_shape: np.ndarray,
    skin_low: np.ndarray,
    skin_cell: float,
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
    """One sample of an arm at rest: `rest` and `explain`. Returns the number of explanations in `rows`, and
    the energy of "nothing touches"; -1 and 0 where a vector has the wrong size or is not finite."""
    arm, memory = unfold(floats, integers, sizes)
    skin = Grids(skin_values, skin_start, skin_shape, skin_low, skin_cell)
    n = sizes[0]
    if not (fits(q, n) and fits(torque, n) and fits(base_wrench, 6) and fits(wrist_wrench, 6)):
        return -1, 0.0
    rest(arm, memory, q, torque, base_wrench, wrist_wrench, external)
    count, nothing = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, threshold)
    return report(arm, memory, skin, count, rows), nothing


@kernel
def batch(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int, int],
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
    for i in range(q.shape[0]):
        rest(arm, memory, q[i], torque[i], base_wrench[i], wrist_wrench[i], external)
        count, nothing[i] = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, -1.0)
        copy(memory.link_probability, link_probability[i])
        if report(arm, memory, skin, min(count, 1), rows) > 0:
            copy(rows[0], best[i])
        else:
            best[i] = 0.0
            best[i, 0] = -1.0
