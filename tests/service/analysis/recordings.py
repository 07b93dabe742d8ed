"""Recordings of the simulated arm for the tests of the analysis."""

from functools import cache
from pathlib import Path

import numpy as np

from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from contactsense.service.recordings.export import write_columns


@cache
def demo() -> Motion:
    """The demo's script: eight contacts on five links in 26 s."""
    return simulate(Script.demo())


def write_motion(
    motion: Motion, path: Path, rounds: int = 1, first: int = 0, last: int | None = None
) -> Path:
    """The readings of a motion as a recording, played that many times."""
    part = slice(first, last)
    columns = {}
    for name, values in (
        ("actual_q", motion.q), ("actual_qd", motion.qd), ("joint_torque", motion.joint_torque),
        ("base_wrench", motion.base_wrench),
    ):  # fmt: skip
        columns |= {f"{name}_{i}": np.tile(values[part, i], rounds) for i in range(values.shape[1])}
    count = len(columns["actual_q_0"])
    write_columns(path, {"timestamp": np.arange(count) / motion.rate, **columns})
    return path
