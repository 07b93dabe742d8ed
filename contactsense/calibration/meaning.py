"""Does the torque signal mean what the scene says? Every other meaning is tried on the same motion."""

from dataclasses import replace
from typing import get_args

import numpy as np

from contactsense.calibration.fit import fit
from contactsense.calibration.linearize import linearize
from contactsense.calibration.parameters import Group, entries
from contactsense.calibration.plant import Plant
from contactsense.calibration.stretch import Stretch
from contactsense.scene import Scene
from contactsense.sensing import Meaning

_FRICTION: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor")
_CLEARLY = 0.7
"""Another setting is worth a warning if its residuals are smaller than this share of the scene's."""
Setting = tuple[Meaning, bool]
"""A meaning, and whether the sign is the other way round."""


def compare_meanings(
    scene: Scene, stretches: list[Stretch], bandwidth: float, every: int
) -> dict[Setting, np.ndarray]:
    """Residual of each joint under each meaning and sign of the torque signal, friction fitted to each.

    Returns:
        Robust standard deviation of each joint's residual, shape (n,) [Nm], NaN for joints that stand still.
    """
    assert scene.joint_torque is not None
    joints = len(scene.robot.joints)
    found: dict[Setting, np.ndarray] = {}
    for meaning in get_args(Meaning):
        sensor = scene.joint_torque.model_copy(update={"meaning": meaning})
        plant = Plant.of(scene.model_copy(update={"joint_torque": sensor}))
        chosen = entries(plant, _FRICTION, 0.1)
        prior = np.array([entry.plausible for entry in chosen])
        for turned in (False, True):
            if turned and meaning == "external":
                continue  # nothing in it tells the sign
            rows = []
            for stretch in stretches:
                if stretch.torque is not None:
                    torque = -stretch.torque if turned else stretch.torque
                    rows += linearize(
                        plant, replace(stretch, torque=torque, reading=None), chosen, bandwidth, every
                    )
            result = fit(rows, prior, np.zeros(len(chosen)), np.ones(len(chosen), dtype=bool), joints)
            found[meaning, turned] = result.sigma
    return found


def doubts(scene: Scene, compared: dict[Setting, np.ndarray]) -> list[str]:
    """Warnings, where another setting fits clearly better than the scene's."""
    assert scene.joint_torque is not None
    stated: Setting = (scene.joint_torque.contains, False)
    score = {setting: float(np.nanmean(np.log(sigma))) for setting, sigma in compared.items()}
    best = min(score, key=lambda setting: score[setting])
    ratio = np.exp(score[best] - score[stated])
    if best == stated or ratio > _CLEARLY:
        return []
    said = {"by_actuator": "on_arm", "on_arm": "by_actuator"}[scene.joint_torque.sign]
    wanted = f"joint_torque.meaning: {best[0]}" + (f", joint_torque.sign: {said}" if best[1] else "")
    return [
        f"the torque signal fits another setting better: {wanted} leaves residuals of {100.0 * ratio:.0f} % "
        f"of those under the scene's ({stated[0]}, {scene.joint_torque.sign})"
    ]
