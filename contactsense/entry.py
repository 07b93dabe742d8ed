"""The compiled functions that Python calls, once per sample or once per batch; each opens a `Workspace`
first."""

import math

import numpy as np

from contactsense.observer import GAIN
from contactsense.pipeline import explain, follow, rest
from contactsense.report import report
from contactsense.workspace import unfold
from robots.compiled import kernel
from robots.grid import Grids


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
    bandwidth: float,
    matched: tuple[bool, bool],
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    gate: bool,
    threshold: float,
    rows: np.ndarray,
) -> tuple[int, float]:
    """One sample of a live stream: `follow`, and `explain` if any sensor's residual can be used.

    Returns:
        Number of explanations in `rows`, and the energy of "nothing touches", -1 where no sensor can be used.
    """
    arm, memory = unfold(floats, integers, sizes)
    follow(arm, memory, q, qd, torque, base_wrench, wrist_wrench, steps, bandwidth, matched)
    if not (has_base or has_torque):
        return 0, -1.0
    # A sensor that has missed a sample passes a little more of its noise: the noisiest counts.
    scale = 0.0
    if has_base:
        scale = max(scale, memory.base.clock[GAIN])
    if has_torque:
        scale = max(scale, memory.joints.clock[GAIN])
    if has_wrist:
        scale = max(scale, memory.wrist.clock[GAIN])
    count, nothing = explain(arm, memory, has_base, has_torque, has_wrist, scale, gate, threshold)
    return report(arm, memory, skin, count, rows), nothing


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
    for i in range(q.shape[0]):
        rest(arm, memory, q[i], torque[i], base_wrench[i], wrist_wrench[i], external)
        count, nothing[i] = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, -1.0)
        link_probability[i] = memory.link_probability
        if report(arm, memory, skin, min(count, 1), rows) > 0:
            best[i] = rows[0]
        else:
            best[i] = 0.0
            best[i, 0] = -1.0
