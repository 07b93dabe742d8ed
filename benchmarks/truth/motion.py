"""Moving arms that are touched: runs at standstill, slow and fast, then runs with two contacts at a time."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from . import arrays, schedule, simulation, trajectory
from .arm import Arm
from .columns import Touched, contact_columns
from .exposure import Exposure
from .postures import Postures
from .surface import Surface
from .touches import Touch, Toucher
from .trajectory import Trajectory

_SECONDS = (20, 10)
"""Duration of a run with single contacts and of one with pairs [s]."""
_SLOTS = 2


class Run(NamedTuple):
    """One run of N samples."""

    kind: int
    """Index in `trajectory.KINDS`."""
    multi: bool
    """Whether contacts come in pairs."""
    trajectory: Trajectory
    touches: Sequence[Touch]


def make(arm: Arm, runs: int, seed: int, step: Callable[[], None] = lambda: None) -> dict[str, np.ndarray]:
    """Arrays of `motion_ROBOT.npz`; shapes, frames and units are those of docs/ground_truth.md.

    Args:
        arm: The arm.
        runs: Number of runs R, at least 1; the last quarter of them has pairs of contacts.
        seed: The same seed gives the same arrays.
        step: Called after each run.
    """
    rng = np.random.default_rng((seed, 1))
    postures, surface = Postures(arm), Surface(arm.links)
    toucher = Toucher(surface, Exposure(arm))
    model, drawn, columns = simulation.dynamics(arm), [], []
    for number in range(runs):
        # The first run is fast: one run alone shows most.
        kind, multi = (2 - number) % len(trajectory.KINDS), number >= runs - runs // 4
        samples = round(_SECONDS[multi] * arrays.RATE)
        moved = trajectory.draw(arm, postures, kind, samples, rng)
        planned = schedule.pairs(samples, rng) if multi else schedule.singles(samples, rng)
        run = Run(kind, multi, moved, _touches(toucher, planned, moved.q, rng))
        drawn.append(run)
        columns.append(measured(model, run))
        step()
    together = {name: np.concatenate([column[name] for column in columns]) for name in columns[0]}
    lengths = [len(run.trajectory.q) for run in drawn]
    return {
        **together,
        **arrays.noise(rng, sum(lengths), runs, len(arm.speeds)),
        "run": np.repeat(np.arange(runs), lengths).astype(np.int16),
        "run_kind": np.array([run.kind for run in drawn], dtype=np.int8),
        "run_multi": np.array([run.multi for run in drawn]),
        **_events(drawn),
        "gravity": np.array(simulation.GRAVITY),
        "meta": arrays.described(arm, "motion", seed),
    }


def _touches(
    toucher: Toucher, planned: Sequence[schedule.Planned], q: np.ndarray, rng: np.random.Generator
) -> list[Touch]:
    """Contacts of one run; every other one has torsion, the second one of a pair is on another link."""
    touches: list[Touch] = []
    for number, one in enumerate(planned):
        without = touches[-1].link if one.slot == 1 else None
        touches.append(toucher.draw(one, q[one.start : one.stop], number % 2 == 1, without, rng))
    return touches


def measured(model: mujoco.MjModel, run: Run) -> dict[str, np.ndarray]:
    """Columns of one run: what the joints do, what touches the arm, what its sensors read.

    Args:
        model: Of `simulation.dynamics`.
        run: Joints and contacts.
    """
    q, qd, qdd = run.trajectory
    shape = len(q), _SLOTS
    zero = np.zeros((*shape, 3))
    touched = Touched(np.full(shape, -1), zero, zero.copy(), zero.copy(), np.zeros(shape, dtype=np.float32))
    for touch in run.touches:
        where = slice(touch.planned.start, touch.planned.stop), touch.planned.slot
        values = (touch.link, touch.points, touch.normals, touch.forces, touch.torsions)
        for column, value in zip(touched, values, strict=True):
            column[where] = value
    return {
        "t": np.arange(len(q)) / arrays.RATE,
        "q": q,
        "qd": qd.astype(np.float32),
        "qdd": qdd.astype(np.float32),
        "active": touched.link >= 0,
        **contact_columns(model, q, qd, qdd, touched),
    }


def _events(runs: Sequence[Run]) -> dict[str, np.ndarray]:
    """The table of contacts; samples are counted over all runs."""
    begins = np.cumsum([0, *(len(run.trajectory.q) for run in runs)])
    rows = [(number, touch) for number, run in enumerate(runs) for touch in run.touches]
    whole = {
        "run": [number for number, _ in rows],
        "slot": [touch.planned.slot for _, touch in rows],
        "start": [begins[number] + touch.planned.start for number, touch in rows],
        "stop": [begins[number] + touch.planned.stop for number, touch in rows],
        "type": [touch.planned.type for _, touch in rows],
        "link": [touch.link for _, touch in rows],
        "draw": [touch.by_link for _, touch in rows],
    }
    real = {
        "fn0": [touch.peak for _, touch in rows],
        "ramp_on": [touch.ramps[0] for _, touch in rows],
        "ramp_off": [touch.ramps[1] for _, touch in rows],
        "speed": [touch.speed for _, touch in rows],
        "path": [touch.path for _, touch in rows],
        "mu": [touch.friction for _, touch in rows],
        "xi_ratio": [touch.torsion_ratio for _, touch in rows],
    }
    return {f"ev_{name}": np.array(column, dtype=np.int64) for name, column in whole.items()} | {
        f"ev_{name}": np.array(column, dtype=np.float64) for name, column in real.items()
    }
