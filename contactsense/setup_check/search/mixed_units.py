"""Recordings in which the positions of some joints are in degrees, and those of others in rad.

Their velocities may be in the same units, so that they tell nothing. A joint beyond what the arm reaches, or
faster than it can be, is in degrees. The others are so, too, unless the readings say otherwise.
"""

from dataclasses import replace

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.scene import Scene
from contactsense.setup_check.findings.signal_findings import named_joints
from contactsense.setup_check.findings.unexplained import unexplained_signals
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.search.explanation import EVIDENCE
from contactsense.setup_check.setup import Setup
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from contactsense.setup_check.usable_recordings import CheckError

_TOO_FAST = 2.0
"""A joint that is faster than its limit by this factor is not in rad/s."""


def check_units(
    scene: Scene, parts: list[FreeMotion], readings: Readings, fitter: Fitter, stated: Setup
) -> None:
    """Refuse recordings with positions in two units, where that explains the readings.

    Args:
        scene: What is checked.
        parts: Recordings without gaps.
        readings: Theirs.
        fitter: Of them, in one unit.
        stated: The setup of the scene.

    Raises:
        CheckError: The positions of some joints are in degrees, those of others are not.
    """
    degrees = _not_in_radians(scene, parts)
    if not degrees.any() or degrees.all():
        return
    unit = np.where(degrees, np.pi / 180.0, 1.0)
    converted = [replace(part, q=unit * part.q, qd=unit * part.qd) for part in parts]
    mixed = Fitter(scene, MotionBases({scene.robot.name: scene}, converted), readings)
    found = mixed.fit(stated)
    mixed.set_effective_rows(found.residual)
    fitter.effective[:] = mixed.effective
    one_unit = [fitter.fit(replace(stated, angle_unit=unit)) for unit in (1.0, np.pi / 180.0)]
    gain = min(map(fitter.cost, one_unit)) - mixed.cost(found)
    # With another wrong line beside it nothing is sure: in the wrong unit a joint may seem to fit better.
    if gain > EVIDENCE and not unexplained_signals(scene, mixed, readings, found):
        raise CheckError(
            f"{parts[0].name}: q: expected the positions of all joints in one unit, got degrees for "
            f"{named_joints(scene, np.flatnonzero(degrees))} and rad for "
            f"{named_joints(scene, np.flatnonzero(~degrees))}, by the arm's limits and the sensors"
        )


def _not_in_radians(scene: Scene, parts: list[FreeMotion]) -> np.ndarray:
    """Which joints are beyond their limits in rad and rad/s, shape (n,), bool."""
    limits = PlausibleLimits(scene)
    q = np.concatenate([part.q for part in parts])
    ends = np.array([q.min(axis=0), q.max(axis=0)])
    alone = [[limits.position(row) is not None for row in np.diag(end)] for end in ends]
    fastest = np.abs(np.concatenate([part.qd for part in parts])).max(axis=0)
    limit = np.array([joint.velocity_limit for joint in scene.robot.joints])
    return np.asarray(np.any(alone, axis=0) | (fastest > _TOO_FAST * limit))
