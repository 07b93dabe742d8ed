"""What signals say by themselves: values that stay the same while the arm moves, and joint velocities that
are not those with which the joint positions change."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contactsense.calibration.free_motion import FreeMotion
from contactsense.scene import Scene
from contactsense.sensors.settings import COMPONENTS
from contactsense.setup_check.lines import (
    FROZEN_TORQUES,
    FROZEN_VALUES,
    VELOCITIES,
    Line,
    recorded_sensors,
    sensors_in,
    signal_line,
    wrench_fields,
)
from contactsense.setup_check.result import Finding
from contactsense.setup_check.usable_recordings import CheckError

_LASTS = 1.0
"""No sensor has the same reading for so long [s] while the arm moves: its noise alone changes it."""
_SAME = 1e-9
"""Values this close, relative to 1 or their size, are the same: some are converted to other axes and back."""
_MOVED = 0.05
"""The joint, or any joint for a force/torque sensor, moves by more than this meanwhile [rad]."""
_WINDOW = 0.25
"""Movements over this time are compared with the integral of their velocities [s]."""
_DISAGREE = 0.3
"""They contradict each other if they differ by more than this share of the larger, root mean square."""
_SMALL = 0.01
"""Smaller movements within such a time show nothing [rad]."""
_UNIT_ERROR = 0.1
"""A ratio of the two this close to that of two units, relative, is taken for it."""
_POSITIONS_IN_DEGREES = "the positions are in degrees, the velocities are not"


def frozen_joints(scene: Scene, recordings: Sequence[FreeMotion]) -> tuple[int, ...]:
    """Indices of the joints whose torques stay the same for a second in which they move.

    External torques are left out: a source may report none below a threshold.
    """
    if scene.joint_torque is None or scene.joint_torque.contains == "external":
        return ()
    found = set()
    for part in recordings:
        if part.torque is not None:
            for j in range(part.q.shape[1]):
                if _frozen(part.t, part.torque[:, j], part.q[:, j : j + 1]):
                    found.add(j)
    return tuple(sorted(found))


def frozen_components(recordings: Sequence[FreeMotion]) -> dict[str, tuple[int, ...]]:
    """Components of each force/torque sensor, by field, that stay the same for a second in which the arm
    moves; without the sensors that have none."""
    found: dict[str, set[int]] = {}
    for part in recordings:
        for field, values in part.readings.items():
            for c in range(6):
                if _frozen(part.t, values[:, c], part.q):
                    found.setdefault(field, set()).add(c)
    return {field: tuple(sorted(components)) for field, components in found.items()}


def _frozen(t: np.ndarray, values: np.ndarray, q: np.ndarray) -> bool:
    """Whether values, shape (N,), stay the same for long enough while some joint moves; `q`: shape (N, k)."""
    changes = np.abs(np.diff(values)) > _SAME * np.maximum(1.0, np.abs(values[1:]))
    bounds = np.concatenate(([0], np.flatnonzero(changes) + 1, [len(values)]))
    long = t[bounds[1:] - 1] - t[bounds[:-1]] >= _LASTS
    return any(
        (np.ptp(q[first:last], axis=0) > _MOVED).any()
        for first, last in zip(bounds[:-1][long], bounds[1:][long], strict=True)
    )


def frozen_findings(
    scene: Scene,
    recordings: Sequence[FreeMotion],
    joints: tuple[int, ...],
    sensors: dict[str, tuple[int, ...]],
) -> list[Finding]:
    """What `frozen_joints` and `frozen_components` say of the lines, for the signals that were recorded."""
    remark = "the same for a second or more while the arm moves: a lost field, or a fault"

    def moves(field: str) -> np.ndarray:
        """Which joints move where the sensor is there, shape (n,), bool."""
        own = [part for part in recordings if field in sensors_in(scene, part)]
        return np.asarray(np.any([np.ptp(part.q, axis=0) > _MOVED for part in own], axis=0))

    there, found = recorded_sensors(scene, recordings), []
    if scene.joint_torque is not None and "joint_torque" in there:
        names = named_joints(scene, joints)
        tells = moves("joint_torque").all() and scene.joint_torque.contains != "external"
        found.append(_frozen_finding(FROZEN_TORQUES, names, remark, bool(tells)))
    for field in wrench_fields(scene):
        if field in there:
            names, tells = ", ".join(COMPONENTS[c] for c in sensors.get(field, ())), moves(field).any()
            found.append(_frozen_finding(signal_line(field, FROZEN_VALUES), names, remark, bool(tells)))
    return found


def named_joints(scene: Scene, joints: Sequence[int] | np.ndarray) -> str:
    """Names of these joints, by their indices."""
    every = len(joints) == len(scene.robot.joints)
    return "all joints" if every else ", ".join(scene.robot.joints[j].name for j in joints)


def _frozen_finding(line: Line, names: str, remark: str, tells: bool) -> Finding:
    if names:
        return Finding(line, "does_not_fit", "none", names, remark)
    if tells:
        return Finding(line, "fits", "none")
    return Finding(line, "cannot_tell", "none", remark="not determined by this motion")


def velocity_finding(scene: Scene, recordings: Sequence[FreeMotion]) -> tuple[Finding, np.ndarray]:
    """Whether the joint velocities are those with which the joint positions change, and the joints of which
    they are not, shape (n,), bool.

    Args:
        scene: What is checked.
        recordings: Without gaps.

    Raises:
        CheckError: The positions of some joints are in degrees, those of others are not.
    """
    moved, integral = (np.concatenate(parts) for parts in zip(*map(_movements, recordings), strict=True))
    sizes = np.sqrt(np.mean(moved**2, axis=0)), np.sqrt(np.mean(integral**2, axis=0))
    apart, largest = np.sqrt(np.mean((moved - integral) ** 2, axis=0)), np.maximum(*sizes)
    wrong = (largest > _SMALL) & (apart > _DISAGREE * largest)
    if not wrong.any():
        if (largest > _SMALL).any():
            return Finding(VELOCITIES, "fits", "as recorded"), wrong
        remark = "not determined by this motion"
        return Finding(VELOCITIES, "cannot_tell", "as recorded", remark=remark), wrong
    names = named_joints(scene, np.flatnonzero(wrong))
    reason = _reason(moved[:, wrong], integral[:, wrong])
    others = named_joints(scene, np.flatnonzero((largest > _SMALL) & ~wrong))
    if reason == _POSITIONS_IN_DEGREES and others:
        raise CheckError(
            f"{recordings[0].name}: q: expected the positions of all joints in one unit, got degrees for "
            f"{names} and rad for {others}, by the velocities"
        )
    if reason == _POSITIONS_IN_DEGREES:
        # The line on the unit of the positions corrects them, and keeps the velocities.
        return Finding(VELOCITIES, "cannot_tell", "as recorded", remark=reason), np.zeros_like(wrong)
    remark = f"{names}: {reason}"
    proposed = "those with which the positions change"
    return Finding(VELOCITIES, "does_not_fit", "as recorded", proposed, remark), wrong


def _movements(part: FreeMotion) -> tuple[np.ndarray, np.ndarray]:
    """Movements over `_WINDOW` [rad] and the integrals of their velocities, shape (K, n) each."""
    steps = 0.5 * np.diff(part.t)[:, None] * (part.qd[1:] + part.qd[:-1])
    sums = np.concatenate((np.zeros((1, part.q.shape[1])), np.cumsum(steps, axis=0)))
    at = np.searchsorted(part.t, np.arange(part.t[0], part.t[-1], _WINDOW))
    return np.diff(part.q[at], axis=0), np.diff(sums[at], axis=0)


def _reason(moved: np.ndarray, integral: np.ndarray) -> str:
    """In words, how movements and integrals of velocities differ, shape (K, k) each."""
    positions, velocities = float(np.square(moved).sum()), float(np.square(integral).sum())
    ratio = float(np.sum(moved * integral)) / velocities if velocities > 0.0 else 0.0
    # Units first: their ratio is large, and one of the two would seem to stay the same.
    if positions == 0.0 or np.square(moved - ratio * integral).sum() > 0.1 * positions:
        if velocities < 0.01 * positions:
            return "the velocities stay near zero"
        if positions < 0.01 * velocities:
            return "the positions stay the same"
        return "the velocities follow another motion"
    usual = {
        np.pi / 180.0: "the velocities are in degrees",
        180.0 / np.pi: _POSITIONS_IN_DEGREES,
        -1.0: "the velocities have the opposite sign",
    }
    near = (text for value, text in usual.items() if abs(ratio / value - 1.0) < _UNIT_ERROR)
    return next(near, f"the positions change {ratio:.3g} times as fast: is it the unit of the times?")


def with_own_velocities(part: FreeMotion, wrong: np.ndarray) -> FreeMotion:
    """The recording with the rates of the joint positions as velocities of the joints `wrong`, shape (n,)."""
    return replace(part, qd=np.where(wrong, np.gradient(part.q, part.t, axis=0), part.qd))
