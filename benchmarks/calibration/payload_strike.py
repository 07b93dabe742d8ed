"""What an onset in the recordings with a payload is: the wrench that its torques fit, and where the payload
is."""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.calibration import FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.residuals.recording_residuals import residuals
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, build_model, empty_motion

_AFTER = 0.15
"""The largest torques within this time after the onset are taken [s]."""


class Strike(NamedTuple):
    """Something acts on the arm while it carries a payload."""

    t: float
    """Time of the onset since the start of the recording [s]."""
    force: tuple[float, float, float]
    """Force on the arm, base axes [N]."""
    distance: float
    """Of its line of action from the flange [m]."""
    pitch: float
    """Moment along the force per force [m]: zero for a push at one place."""
    height: float
    """Of the payload's centre of mass above the base origin [m]."""
    lowest: float
    """The lowest height in the whole recording [m]."""


def strike(scene: Scene, recording: FreeMotion, onset: float) -> Strike:
    """The wrench on the last link that explains all joint torques after an onset.

    Args:
        scene: The arm with its payload.
        recording: The motion.
        onset: Time since the start of the recording [s].
    """
    t = recording.t - recording.t[0]
    joints = recording.q.shape[1]
    torque = residuals(CalibrationModel.of(scene), recording, scene.bandwidth)[:, :joints]
    rows = np.flatnonzero((t >= onset) & (t < onset + _AFTER))
    row = rows[np.argmax(np.linalg.norm(torque[rows], axis=1))]
    motion, model = empty_motion(joints), build_model(scene.robot)
    heights = []
    for q in recording.q:
        forward_kinematics(model, q, motion)
        heights.append(_payload(scene, motion)[1][2])
    forward_kinematics(model, recording.q[row], motion)
    wrench = np.linalg.solve(motion.screw, torque[row])
    force, moment = wrench[:3], wrench[3:]
    flange, _ = _payload(scene, motion)
    about_flange = moment - np.cross(flange, force)
    size = float(force @ force)
    return Strike(
        onset,
        (float(force[0]), float(force[1]), float(force[2])),
        float(np.linalg.norm(np.cross(force, about_flange)) / size),
        float(force @ moment / size),
        float(heights[row]),
        float(min(heights)),
    )


def _payload(scene: Scene, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Flange and payload's centre of mass in the base frame [m]."""
    assert scene.tool is not None
    R = motion.rotation[-1]
    flange = motion.origin[-1] + R @ scene.robot.flange_translation
    return flange, flange + R @ scene.robot.flange_rotation @ np.array(scene.tool.com)
