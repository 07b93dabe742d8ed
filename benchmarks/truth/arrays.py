"""What the files of both suites have in common: binary grids, noise, description."""

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

from .arm import Arm

POSITION = 2.0**-30
"""Grid of joint positions [rad]."""
SPEED = 2.0**-22
"""Grid of joint speeds [rad/s]."""
ACCELERATION = 2.0**-16
"""Grid of joint accelerations [rad/s^2]."""
LENGTH = 2.0**-23
"""Grid of contact points [m]."""
FORCE = 2.0**-16
"""Grid of contact forces [N]."""
READING = 2.0**-24
"""Grid of what the sensors read [N, Nm]."""
RATE = 500.0
"""Samples per second of the moving suite."""


def on_grid(values: np.ndarray, step: float) -> np.ndarray:
    """Values rounded to multiples of `step`: inputs before the dynamics, so that what is stored is exact."""
    return np.asarray(np.round(values / step) * step)


def noise(rng: np.random.Generator, samples: int, runs: int, joints: int) -> dict[str, np.ndarray]:
    """White noise of unit variance for each sample, and one bias of unit variance for each run."""
    return {
        "noise_tau": rng.standard_normal((samples, joints)).astype(np.float16),
        "noise_wrench": rng.standard_normal((samples, 6)).astype(np.float16),
        "bias_tau": rng.standard_normal((runs, joints)).astype(np.float32),
        "bias_wrench": rng.standard_normal((runs, 6)).astype(np.float32),
    }


def described(arm: Arm, suite: str, seed: int) -> np.ndarray:
    """JSON of suite, arm, seed and versions as an array without dimensions."""
    facts = {
        "suite": suite,
        "robot": arm.name,
        "seed": seed,
        "links": [link.name for link in arm.links],
        "rate_hz": RATE,
        "mujoco": version("mujoco"),
        **({arm.package: version(arm.package)} if arm.package else {}),
        "mass": round(arm.mass, 6),
    }
    return np.array(json.dumps(facts))


def write(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Compressed; a file that cannot be finished is not left behind.

    Raises:
        OSError: the file cannot be written.
    """
    unfinished = path.with_suffix(".part")
    try:
        with unfinished.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
