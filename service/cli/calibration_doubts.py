"""Reasons not to use the result of a calibration: a fit bends what it may change, also where another line of
the scene is wrong."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from contactsense.calibration import Calibration, FreeMotion
from contactsense.calibration.parameters import INERTIA_ERROR
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.sensors.arm_limits import in_this_arm, within_the_joints
from contactsense.sensors.field_checks import carried_by
from contactsense.service.scene.load_warnings import load_warnings, tensor_warnings
from contactsense.service.sensors.signal_mapping import TorqueMap
from contactsense.setup_check import CheckError, Line, check
from contactsense.setup_check.findings.unexplained import NOT_EXPLAINED

ESTIMATED: tuple[Line, ...] = (
    "mounting", "tool", "tool.mass", "tool.com", ".rpy", ".translation", ".delay", ".bias",
    ".torque_constants",
)  # fmt: skip
"""Lines, by their ends, that a calibration corrects itself."""


def doubts(found: Calibration, scene: Scene, recordings: list[FreeMotion]) -> tuple[str, ...]:
    """Why the calibrated scene should not be used, one phrase each with the field; none: nothing is known.

    Args:
        found: The result.
        scene: The scene before.
        recordings: What was calibrated with.
    """
    # Only sums over links are determined: the tensor of one may be far from the robot's data.
    own = {*load_warnings(scene), *tensor_warnings(found.scene)}
    reasons = [*_impossible(found), *(text for text in load_warnings(found.scene) if text not in own)]
    free = [_without_contacts(part, found) for part in recordings]
    links = scene.robot.links if found.inertia else ()
    estimated = (*ESTIMATED, *(f"inertia.{link.name}" for link in links))
    named: set[str] = set()
    unexplained: tuple[str, ...] = ()
    for checked, corrected in ((scene, estimated), (found.scene, ())):
        try:
            parts = [as_read_with(checked, scene, part) for part in free]
            result = check(checked, parts, leave_out_contacts=False)
        except (CheckError, ValueError):  # such as too short a motion: nothing is known
            continue
        wrong = [
            item for item in result.wrong if item.line not in named and not item.line.endswith(corrected)
        ]
        for item in wrong:
            text = f"{item.line}: got {item.stated}; {item.proposed} would fit"
            reasons.append(f"{text} ({item.remark})" if item.remark else text)
        named.update(item.line for item in wrong)
        unexplained = result.unexplained
    # What the scene before leaves, calibration may explain: friction of another kind, say.
    if unexplained:
        reasons.append(f"{NOT_EXPLAINED}: {'; '.join(unexplained)}")
    return tuple(dict.fromkeys(reasons))


def as_read_with(scene: Scene, former: Scene, part: FreeMotion) -> FreeMotion:
    """A recording that was read with the `former` scene, with joint torques by the constants of `scene`."""
    now, before = TorqueMap.of(scene), TorqueMap.of(former)
    if part.torque is None or now is None or before is None or now.is_as(before):
        return part
    return replace(part, torque=part.torque * (now.scale / before.scale))


def _impossible(found: Calibration) -> list[str]:
    """What no part of the arm can be: a scene file with it would be refused."""
    scene = found.scene
    checks: list[Callable[[], None]] = [partial(carried_by, scene.robot.mass, scene.tool or Tool())]
    checks += [partial(in_this_arm, scene.robot, *item) for item in (scene.inertia or {}).items()]
    if scene.joint_torque is not None:
        checks.append(partial(within_the_joints, scene.robot, scene.joint_torque))
    reasons = []
    for one in checks:
        try:
            one()
        except ValueError as error:
            reasons.append(str(error))
    mass = next((v for v in found.values if v.entry.group == "payload" and v.entry.index == (0,)), None)
    # A payload takes up what the links' data are wrong by.
    lowest = -INERTIA_ERROR * scene.robot.mass
    if mass is not None and mass.after + 2.0 * mass.std < lowest:
        reasons.append(f"tool.mass: expected at least {lowest:.2g} kg, got {mass.after:.3g} kg")
    return reasons


def _without_contacts(part: FreeMotion, found: Calibration) -> FreeMotion:
    """The recording without the stretches that the calibration has left out."""
    time = part.t - part.t[0]
    touched = np.zeros(len(time), dtype=bool)
    for contact in found.contacts:
        if contact.within(part):
            touched |= (time >= contact.start) & (time <= contact.stop)
    rows = np.flatnonzero(~touched)
    return part.part(rows) if len(rows) >= 3 else part
