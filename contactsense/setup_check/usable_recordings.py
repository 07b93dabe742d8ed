"""Whether recordings can be used for a check of a scene."""

from collections.abc import Mapping

from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.residuals.recording_residuals import GAP
from contactsense.scene import Scene
from contactsense.setup_check.terms.instants import instants

FROZEN, AT_RANGE = "its readings stay the same", "the sensor is at its range"
"""Why a sensor is not used."""
_MIN_ROWS = 7
"""Fewer instants are not enough."""


class CheckError(ValueError):
    """The recordings cannot be used for a check; the message gives the reason and a remedy."""


def with_all_sensors(scene: Scene, recordings: list[FreeMotion]) -> list[FreeMotion]:
    """The recordings that have every sensor of the scene that any of them has: all are compared together, and
    one that lacks a sensor would hide what it reads in the others.

    Raises:
        CheckError: None has them all.
    """
    there = [sensors_in(scene, part) for part in recordings]
    every = frozenset[str]().union(*there)
    found = [part for part, own in zip(recordings, there, strict=True) if own == every]
    if recordings and not found:
        raise CheckError(
            f"expected a recording with all of {', '.join(sorted(every))}, got them in different recordings: "
            "check those one by one"
        )
    return found


def sensors_in(scene: Scene, part: FreeMotion) -> frozenset[str]:
    """Fields of the scene's sensors that a recording has."""
    known = {"joint_torque": scene.joint_torque, "base_wrench": scene.base_wrench, **scene.link_sensors}
    own = part.readings.keys() | ({"joint_torque"} if part.torque is not None else set())
    return frozenset(field for field, sensor in known.items() if sensor is not None and field in own)


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
        CheckError: There are none, they are those of another arm, have none of the scene's sensors, or are
            too short.
    """
    if not recordings:
        raise CheckError("expected at least one recording of contact-free motion, got none")
    joints = len(scene.robot.joints)
    for part in recordings:
        if part.q.shape[1] != joints:
            raise CheckError(
                f"{part.name}: expected {joints} joints, as {scene.robot.name} has, got {part.q.shape[1]}"
            )
    if unusable and not any(part.torque is not None or part.reading is not None for part in recordings):
        field, reason = next(iter(unusable.items()))
        problem = f"{field}: expected readings that change with the motion, got the same for a second or more"
        if reason == AT_RANGE:
            problem = f"{field}.range: expected readings within it, got readings that stay at it"
        raise CheckError(f"{recordings[0].name}: {problem}")
    if all(part.torque is None or scene.joint_torque is None for part in recordings) and all(
        part.reading is None or scene.base_wrench is None for part in recordings
    ):
        raise CheckError(
            f"{recordings[0].name}: expected joint torques or base wrenches as in the scene, got neither"
        )
    if sum(len(at.nodes) for at in instants(parts)) < _MIN_ROWS:
        seconds = sum(part.seconds for part in recordings)
        raise CheckError(
            f"{recordings[0].name}: expected at least 3 s without gaps above {GAP} s, got {seconds:.2g} s"
        )
