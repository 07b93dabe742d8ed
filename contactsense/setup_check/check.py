"""Check a scene against contact-free motion: which of its lines fit, which do not, which the motion does not
determine.

`contactsense.setup_check.search.wrong_lines` finds the lines whose change explains the readings. What its
last round has not accepted is assessed by how well the motion determines it.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from contactsense import robots
from contactsense.calibration.free_motion import FreeMotion, check_recordings
from contactsense.scene import Scene, check_scene
from contactsense.setup_check.findings.drive_friction import unstated_friction
from contactsense.setup_check.findings.proposals import as_sign_and_turn, line_value
from contactsense.setup_check.findings.sensor_findings import (
    base_offset,
    bias_findings,
    range_findings,
    residuals_of,
    saturated_sensors,
    without,
)
from contactsense.setup_check.findings.signal_findings import (
    frozen_components,
    frozen_findings,
    frozen_joints,
    velocity_finding,
    with_own_velocities,
)
from contactsense.setup_check.findings.unexplained import unexplained_signals
from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.hypotheses.all_hypotheses import Hypotheses
from contactsense.setup_check.lines import (
    FROZEN_TORQUES,
    TOOL,
    TOOL_COM,
    TOOL_MASS,
    Line,
    lines,
    sensor_lines,
    sensor_of,
    torque_lines,
    wrench_fields,
)
from contactsense.setup_check.recorded_contacts import used_samples, without_contacts
from contactsense.setup_check.result import FITS_BETTER, NOT_RECORDED, Finding, SetupCheck, Verdict
from contactsense.setup_check.search.candidate import Candidate
from contactsense.setup_check.search.change import groups
from contactsense.setup_check.search.changes import matters, tolerance
from contactsense.setup_check.search.explanation import EXCLUDED, Explanation
from contactsense.setup_check.search.mixed_units import check_units
from contactsense.setup_check.search.wrong_lines import searched
from contactsense.setup_check.setup import Free, Setup
from contactsense.setup_check.terms.instants import without_gaps
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings
from contactsense.setup_check.usable_recordings import (
    AT_RANGE,
    FROZEN,
    TOO_SHORT,
    CheckError,
    check_joints,
    check_usable,
    check_values,
    sensors_too_short,
)

_MOVES, _MOVING_SHARE = 0.02, 0.3
"""A joint moves if it is faster than this [rad/s] for more than this share of the time."""
_BETTER = 6.0
"""A value is said to fit better if twice the log likelihood rises by more than this: strong evidence in the
scale of R. E. Kass and A. E. Raftery (see `contactsense.setup_check.fit.fitter`), and less than proposals
need."""


def check(
    scene: Scene,
    recordings: list[FreeMotion],
    progress: Callable[[str], None] = lambda _: None,
    leave_out_contacts: bool = True,
) -> SetupCheck:
    """Check a scene against recordings of contact-free motion, or of some postures.

    Args:
        scene: What is to be checked.
        recordings: Read under this scene; the base sensor's readings not shifted by its delay. A sensor that
            is at its range is not used. Each sensor is judged from the recordings that have it.
        progress: Called with the name of the next stage.
        leave_out_contacts: Whether stretches in which something seems to push on the arm are left out, where
            no lines explain the readings.

    Raises:
        CheckError: The recordings are too short, or lack all sensors of the scene.
        TypeError: `scene` or `recordings` is of another type.
    """
    check_scene(scene)
    check_recordings(recordings)
    check_joints(scene, recordings)
    check_values(scene, recordings)
    recordings = used_samples(recordings)
    found = _checked(scene, recordings, progress)
    # Wrong lines that explain everything need no push beside them, which might hide them: a load on a link
    # may show in one posture only.
    if not found.unexplained or not leave_out_contacts:
        return found
    progress("contacts")
    rest = without_contacts(scene, recordings)
    if not rest.contacts:
        return found
    try:
        return replace(_checked(scene, rest.recordings, progress), contacts=rest.contacts)
    except CheckError:  # too little is left
        return replace(found, contacts=rest.contacts, contacts_left_out=False)


def _checked(scene: Scene, recordings: list[FreeMotion], progress: Callable[[str], None]) -> SetupCheck:
    """The check of all that was recorded; arguments and errors as for `check`."""
    saturated = saturated_sensors(scene, recordings)
    recordings = [without(part, saturated) for part in recordings]
    still = frozen_joints(scene, recordings)
    frozen = frozen_components(recordings)
    signals = frozen_findings(scene, recordings, still, frozen) if recordings else []
    unusable = {**dict.fromkeys(saturated, AT_RANGE), **dict.fromkeys(frozen, FROZEN)}
    if len(still) == len(scene.robot.joints):
        unusable["joint_torque"] = FROZEN
    recordings = [without(part, unusable) for part in recordings]
    parts = without_gaps(recordings)
    check_usable(scene, recordings, parts, unusable)
    short = sensors_too_short(scene, recordings, parts)
    unusable |= dict.fromkeys(short, TOO_SHORT)
    parts = [without(part, short) for part in parts]
    velocities, wrong_joints = velocity_finding(scene, parts)
    parts = [with_own_velocities(part, wrong_joints) for part in parts] if wrong_joints.any() else parts
    signals.append(velocities)
    progress("motion")
    readings = Readings.of(scene, parts)
    others = other_arms(scene)
    bases = MotionBases({scene.robot.name: scene, **others}, parts)
    fitter = Fitter(scene, bases, readings)
    largest = max(float(np.abs(part.q).max()) for part in parts)
    torque = readings.torque is not None
    hypotheses = Hypotheses(scene, others, largest, torque, readings.wrenches, _moving(parts))
    setup = Setup.of(scene)
    setup.gain[list(still)] = 0.0
    check_units(scene, parts, readings, fitter, setup)
    wrong = [item for item in signals if item.verdict == "does_not_fit"]
    found = searched(fitter, hypotheses, setup, progress)
    now, candidates = found.now, found.candidates
    if found.explanation is not None:
        wrong += _wrong_lines(fitter, scene, setup, found.explanation)
    own = [*range_findings(scene, recordings, now.setup, saturated), *bias_findings(scene, now)]
    wrong += [item for item in own if item.verdict == "does_not_fit"]
    reported = {item.line for item in wrong}
    unexplained = unexplained_signals(scene, fitter, readings, now)
    rest = [
        _judged(fitter, scene, now, candidate)
        for candidate in candidates
        if not candidate.hypothesis.special and not _covered(candidate.hypothesis.line, reported)
    ]
    rest += [item for item in own if item.verdict != "does_not_fit"]
    doubted = _silent_joints(fitter, now, candidates)
    for item in signals:
        if item.line not in reported:
            doubt = item.line == FROZEN_TORQUES and item.verdict == "fits" and doubted
            rest.append(replace(item, verdict="cannot_tell", remark=doubted) if doubt else item)
    known = {item.line for item in signals}
    rest += [item for item in _not_recorded(scene, now.setup, readings, unusable) if item.line not in known]
    order = lines(scene)
    rest.sort(key=lambda item: order.index(item.line))
    return SetupCheck(
        (*wrong, *(rest if not unexplained else map(_undetermined, rest))),
        residuals_of(now, wrench_fields(scene)),
        unexplained,
        sum(part.seconds for part in parts),
        None if unexplained or wrong else base_offset(scene, fitter, now.setup),
        None if unexplained or wrong else unstated_friction(scene, fitter, now.setup),
    )


def _moving(parts: list[FreeMotion]) -> np.ndarray:
    """Which joints move for a good part of the time in which their torques are measured, or of all if they
    never are, shape (n,), bool."""
    measured = [part for part in parts if part.torque is not None] or parts
    faster = np.abs(np.concatenate([part.qd for part in measured])) > _MOVES
    return np.asarray(faster.mean(axis=0) > _MOVING_SHARE)


def other_arms(scene: Scene) -> dict[str, Scene]:
    """The scene with each arm of the library that has as many joints."""
    found = {}
    for name in robots.names():
        robot = robots.load(name)
        if name != scene.robot.name and len(robot.joints) == len(scene.robot.joints):
            # Arms with as many joints have as many links, under other names.
            other = dict(zip(scene.robot.link_names, robot.link_names, strict=True))
            links = tuple(
                sensor.model_copy(update={"link": other[sensor.link]}) for sensor in scene.link_wrenches
            )
            update = {"robot": robot, "inertia": None, "kinematics": None, "link_wrenches": links}
            found[name] = scene.model_copy(update=update)
    return found


def _cost_increase(fitter: Fitter, now: Fit, other: Fit) -> float:
    return fitter.cost(other) - fitter.cost(now)


def _silent_joints(fitter: Fitter, now: Fit, candidates: list[Candidate]) -> str:
    """Why it is not known that all torques are measured; empty: it is."""
    names = [
        fitter.joint_names[c.hypothesis.joint]
        for c in candidates
        if c.hypothesis.line == FROZEN_TORQUES
        and c.hypothesis.joint is not None
        and _cost_increase(fitter, now, c.fit) < EXCLUDED
    ]
    return f"{', '.join(names)}: noise would fit as well" if names else ""


def _undetermined(found: Finding) -> Finding:
    """The finding where readings remain that nothing explains: no line can be said to fit."""
    if found.remark == NOT_RECORDED:
        return found
    return replace(found, verdict="cannot_tell", remark="the readings are not explained")


def _wrong_lines(fitter: Fitter, scene: Scene, stated: Setup, found: Explanation) -> list[Finding]:
    """The lines that an explanation changes, those first without which it explains least. A line whose
    changes amount to none is left out."""
    return [
        finding
        for line in sorted(found.lines, key=lambda line: -found.evidence(fitter, line))
        if (finding := _wrong_line(fitter, scene, stated, found, line)).proposed != finding.stated
    ]


def _wrong_line(fitter: Fitter, scene: Scene, stated: Setup, found: Explanation, line: Line) -> Finding:
    fields, before = wrench_fields(scene), found.without[line]
    own = [change for change in found.changes if change.line == line]
    proposed, remark = line_value(line, found.fit.setup, scene)
    free = groups(*(change.free for change in own))
    shown = np.repeat([group in free for group in found.fit.free], [group.size for group in found.fit.free])
    text, instead = own[-1].text, as_sign_and_turn(line, found.fit.setup, scene)
    return Finding(
        line,
        "does_not_fit",
        line_value(line, stated, scene)[0],
        proposed,
        "; ".join(filter(None, (text if text and text != proposed else remark, instead))),
        tuple(found.fit.std[shown.astype(bool)].tolist()),
        residuals_of(before, fields),
        residuals_of(found.fit, fields),
        found.evidence(fitter, line),
        found.rivals[line],
    )


def _not_recorded(
    scene: Scene, setup: Setup, readings: Readings, unusable: Mapping[str, str]
) -> list[Finding]:
    """Lines of sensors that the scene has and a recording lacks, or of which it cannot be used."""
    missing = [field for field in wrench_fields(scene) if field not in readings.wrenches]
    found = [line for field in missing for line in sensor_lines(field) if not line.endswith(".range")]
    if scene.joint_torque is not None and readings.torque is None:
        found += torque_lines(scene)
    return [
        Finding(
            line,
            "cannot_tell",
            line_value(line, setup, scene)[0],
            remark=unusable.get(sensor_of(scene, line) or "joint_torque", NOT_RECORDED),
        )
        for line in found
    ]


def _covered(line: Line, reported: set[Line]) -> bool:
    """Whether a finding already covers a line."""
    return (
        line in reported
        or (line == TOOL and bool(reported & {TOOL_MASS, TOOL_COM}))
        or (line in (TOOL_MASS, TOOL_COM) and TOOL in reported)
    )


def _judged(fitter: Fitter, scene: Scene, now: Fit, candidate: Candidate) -> Finding:
    """Whether the motion determines a line that is not reported as wrong."""
    line = candidate.hypothesis.line
    fits = [candidate.fit, *candidate.others]
    distinct = [found for found in fits if matters(now.setup, found)]
    other = min((_cost_increase(fitter, now, found) for found in distinct), default=None)
    verdict: Verdict = "fits"
    remark = ""
    std: tuple[float, ...] = ()
    if candidate.hypothesis.free:
        # Where there is no tool, it has no centre of mass.
        free = candidate.hypothesis.free if now.setup.mass > 0.0 or line != TOOL else (Free("mass"),)
        here = fitter.fit(now.setup, free, steps=0)
        std = tuple(here.std.tolist())
        each = [group for group in here.free for _ in range(group.size)]
        wide = [
            group for group, spread in zip(each, std, strict=True) if spread > tolerance(group, now.setup)
        ]
        if wide:
            names = [fitter.joint_names[group.joint] for group in wide if group.joint is not None]
            verdict, remark = "cannot_tell", "not determined by this motion"
            remark = f"{', '.join(names)}: {remark}" if names else remark
    if verdict == "fits" and other is not None and other < EXCLUDED:
        verdict = "cannot_tell"
        better = other < -_BETTER
        remark = FITS_BETTER if better else "another value fits as well"
        if better or not candidate.hypothesis.free:
            nearest = min(distinct, key=fitter.cost)
            remark += f": {line_value(line, nearest.setup, scene)[0]}"
    return Finding(line, verdict, line_value(line, now.setup, scene)[0], None, remark, std, evidence=other)
