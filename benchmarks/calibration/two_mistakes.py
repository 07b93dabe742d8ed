"""Simulated cells whose scene has two mistakes at once, each in another line."""

from collections.abc import Mapping

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.calibration.link_sensor_draws import Mistake
from contactsense.benchmarks.calibration.setup_draws import (
    MISTAKES,
    Case,
    Settings,
    cell,
    recorded,
)
from contactsense.calibration import FreeMotion
from contactsense.setup_check import Line


def _left_out(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    return scene.model_copy(update={"tool": None}), recording


_NOT_DRAWN = (
    "joint torques: frozen values",
    "joint velocities: agreement",
    "inertia.forearm",
    "joint torques: delay",
)
"""Lines that signals contradict by themselves, whatever else is wrong; and those whose mistakes must be made
before others: a load moves with positions that are read rightly, and what is late shortens the recording."""
_DRAWN: Mapping[str, tuple[Line, Mistake]] = {
    **{kind: found for kind, found in MISTAKES.items() if found[0] not in _NOT_DRAWN},
    "tool left out": ("tool", _left_out),
}
ARM_AND_TOOL = ("another arm", "tool left out")
"""Each of the two hides the other from a search that looks at one line alone."""


def two_wrong_lines(
    arm: str, seed: int, settings: Settings, torques_alone: bool = False, kinds: tuple[str, str] | None = None
) -> tuple[Case, tuple[Line, Line]]:
    """A scene with two mistakes, and their lines.

    Args:
        arm: Name of the true arm.
        seed: Of the cell, the motion, the noise, and of the mistakes.
        settings: How the cell is drawn.
        torques_alone: Whether the cell has no base sensor.
        kinds: Of the mistakes; None: drawn.
    """
    rng = np.random.default_rng(seed)
    truth = cell(arm, rng)
    if torques_alone:
        truth = truth.model_copy(update={"base_wrench": None})
    first, second = kinds or _pair(rng, torques_alone)
    scene, recording = truth, recorded(truth, rng, settings)
    # A tool is changed before it is left out, and currents are stated before they are scaled.
    for kind in sorted((first, second), key=list(_DRAWN).index):
        scene, recording = _DRAWN[kind][1](scene, recording, rng)
    return Case(scene, recording, None), (_DRAWN[first][0], _DRAWN[second][0])


def _pair(rng: np.random.Generator, torques_alone: bool) -> tuple[str, str]:
    """Two kinds of mistakes in different parts of a scene."""
    kinds = [kind for kind, (line, _) in _DRAWN.items() if not (torques_alone and line.startswith("base"))]
    while True:
        first, second = (kinds[int(i)] for i in rng.choice(len(kinds), 2, replace=False))
        if _part(_DRAWN[first][0]) != _part(_DRAWN[second][0]):
            return first, second


def _part(line: Line) -> str:
    """What a line is about: two mistakes in one of these may amount to one, or to none."""
    scales = ("joint_torque.signal", "joint torques: scale", "joint_torque.torque_constants")
    return "scale of the torques" if line in scales else line.partition(".")[0]


def named(line: Line, accused: list[Line]) -> bool:
    """Whether a wrong line is among those reported; `tool` stands for its mass and centre of mass."""
    return line in accused or (line.startswith("tool") and any(said.startswith("tool") for said in accused))
