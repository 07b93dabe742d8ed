"""Whether recordings can be used for a check of a scene."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.scene import Scene
from contactsense.setup_check.lines import recorded_sensors, sensors_in
from contactsense.setup_check.terms.instants import instants

FROZEN, AT_RANGE = "its readings stay the same", "the sensor is at its range"
TOO_SHORT = "it was recorded for less than 3 s"
"""Why a sensor is not used."""
_LARGEST_UNIT = 1e5
"""Torques in no unit exceed the joints' limits by more than this: those in Nmm do so by up to 1000."""
_MIN_ROWS = 7
"""Fewer instants are not enough."""


class CheckError(ValueError):
    """The recordings cannot be used for a check; the message gives the reason and a remedy."""


def check_joints(scene: Scene, recordings: list[FreeMotion]) -> None:
    """Refuse recordings of another arm: raise a CheckError that names the first that has other joints."""
    joints = len(scene.robot.joints)
    for part in recordings:
        if part.q.shape[1] != joints:
            raise CheckError(
                f"{part.name}: expected {joints} joints, as {scene.robot.name} has, got {part.q.shape[1]}"
            )


def check_values(scene: Scene, recordings: list[FreeMotion]) -> None:
    """Refuse values that no mistake explains: raise a CheckError that names the first joint whose positions
    are beyond its limits in rad and in degrees, or whose torque no unit makes so large."""
    limits = PlausibleLimits(scene)
    for part in recordings:
        for row in (part.q.min(axis=0), part.q.max(axis=0)):
            for alone in np.diag(row):
                found = limits.position(alone)
                if found is not None and limits.position(np.radians(alone)) is not None:
                    expected = found.reason.replace("in rad, ", "in rad, or as much in degrees, ").partition(
                        ";"
                    )[0]
                    raise CheckError(f"{part.name}: {found.field}: {expected}")
        if part.torque is not None:
            found = limits.torque(np.abs(part.torque).max(axis=0), _LARGEST_UNIT)
            if found is not None:
                raise CheckError(f"{part.name}: {found.field}: {found.reason}")


def check_usable(
    scene: Scene, recordings: list[FreeMotion], parts: list[FreeMotion], unusable: Mapping[str, str]
) -> None:
    """Refuse recordings that say too little about a scene.

    Args:
        scene: What is to be checked.
        recordings: The recordings, without the readings of sensors that cannot be used.
        parts: Their parts without gaps, see `contactsense.setup_check.terms.instants.without_gaps`.
        unusable: Fields of those sensors, with `FROZEN` or `AT_RANGE`.

    Raises:
        CheckError: There are none, they have none of the scene's sensors, or are too short.
    """
    if not recordings:
        raise CheckError("expected at least one recording of contact-free motion, got none")
    if unusable and not any(part.torque is not None or part.reading is not None for part in recordings):
        field, reason = next(iter(unusable.items()))
        problem = f"{field}: expected readings that change with the motion, got the same for a second or more"
        if reason == AT_RANGE:
            problem = f"{field}.range: expected readings within it, got readings that stay at it"
        raise CheckError(f"{recordings[0].name}: {problem}")
    there = recorded_sensors(scene, recordings) & {"joint_torque", "base_wrench"}
    if not there:
        raise CheckError(
            f"{recordings[0].name}: expected joint torques or base wrenches as in the scene, got neither"
        )
    if there <= sensors_too_short(scene, recordings, parts):
        seconds = max(_longest(part) for part in recordings if there & sensors_in(scene, part))
        raise CheckError(
            f"{recordings[0].name}: expected at least 3 s without gaps above {GAP} s, got {seconds:.2g} s"
        )


def _longest(part: FreeMotion) -> float:
    """Length of the longest stretch without a gap [s]."""
    ends = np.flatnonzero(np.append(np.diff(part.t) > GAP, True))
    return float(np.max(part.t[ends] - part.t[np.append(0, ends[:-1] + 1)]))


def sensors_too_short(scene: Scene, recordings: list[FreeMotion], parts: list[FreeMotion]) -> frozenset[str]:
    """Fields of the sensors that were recorded for too short a time to be judged; arguments as for
    `check_usable`."""
    rows = Counter[str]()
    for part, at in zip(parts, instants(parts), strict=True):
        rows.update(dict.fromkeys(sensors_in(scene, part), len(at.nodes)))
    return frozenset(field for field in recorded_sensors(scene, recordings) if rows[field] < _MIN_ROWS)
