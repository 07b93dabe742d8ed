"""Check the stated meaning of the torque signal: every other meaning is fitted to the same motion."""

from dataclasses import replace
from typing import get_args

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.robust_least_squares import fit_robust
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import Group, entries
from contactsense.calibration.residuals.residual_jacobian import linearize
from contactsense.scene import Scene
from contactsense.sensors.settings import Meaning

_FRICTION: tuple[Group, ...] = ("bias", "coulomb", "viscous", "rotor")
_MAX_RATIO = 0.7
"""Another setting leads to a warning if its residuals are smaller than this fraction of the scene's."""
Setting = tuple[Meaning, bool]
"""A meaning, and whether the sign is reversed."""


def compare_meanings(
    scene: Scene, recordings: list[FreeMotion], bandwidth: float
) -> dict[Setting, np.ndarray]:
    """Residual of each joint under each meaning and sign of the torque signal, with friction fitted to each.

    Returns:
        Robust standard deviation of each joint's residual, shape (n,) [Nm], NaN for joints that do not move.
    """
    assert scene.joint_torque is not None
    joints = len(scene.robot.joints)
    found: dict[Setting, np.ndarray] = {}
    for meaning in get_args(Meaning):
        sensor = scene.joint_torque.model_copy(update={"meaning": meaning})
        arm = CalibrationModel.of(scene.model_copy(update={"joint_torque": sensor}))
        selected = entries(arm, _FRICTION)
        prior = np.array([entry.prior_std for entry in selected])
        for reversed_sign in (False, True):
            if reversed_sign and meaning == "external":
                continue  # its sign is not identifiable
            rows = []
            for recording in recordings:
                if recording.torque is not None:
                    torque = -recording.torque if reversed_sign else recording.torque
                    rows += linearize(
                        arm, replace(recording, torque=torque, reading=None), selected, bandwidth
                    )
            result = fit_robust(
                rows, prior, np.zeros(len(selected)), np.ones(len(selected), dtype=bool), joints
            )
            found[meaning, reversed_sign] = result.sigma
    return found


def setting_warnings(scene: Scene, residuals_by_setting: dict[Setting, np.ndarray]) -> list[str]:
    """Warnings where another setting fits clearly better than the scene's."""
    assert scene.joint_torque is not None
    stated: Setting = (scene.joint_torque.contains, False)
    if np.isnan(residuals_by_setting[stated]).all():
        return []  # no joint moves
    score = {setting: float(np.nanmean(np.log(sigma))) for setting, sigma in residuals_by_setting.items()}
    best = min(score, key=lambda setting: score[setting])
    ratio = np.exp(score[best] - score[stated])
    if best == stated or ratio > _MAX_RATIO:
        return []
    sign = {"by_actuator": "on_arm", "on_arm": "by_actuator"}[scene.joint_torque.sign]
    wanted = f"joint_torque.meaning: {best[0]}" + (f", joint_torque.sign: {sign}" if best[1] else "")
    return [
        f"the torque signal fits another setting better: {wanted} leaves residuals of {100.0 * ratio:.0f} % "
        f"of those under the scene's ({stated[0]}, {scene.joint_torque.sign})"
    ]
