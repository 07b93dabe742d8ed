"""Calibration from contact-free motion: estimate the identifiable parameters of arm and sensors.

A fit (`contactsense.calibration.fit.gauss_newton`) and a search for contacts in its residuals
(`contactsense.calibration.contacts.contact_test`) take turns until nothing more is left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.contacts.contact_test import SuspectedContact, suspected_contacts
from contactsense.calibration.contacts.trimmed_fit import trimmed_fit
from contactsense.calibration.fit.gauss_newton import FittedModel, fit_model
from contactsense.calibration.fit.possible_bodies import possible_bodies
from contactsense.calibration.free_motion import FreeMotion, check_recordings
from contactsense.calibration.noise.noise_estimation import JointResiduals, NoiseLevels, estimate_noise
from contactsense.calibration.noise.wrench_noise import wrench_noise, wrench_residuals
from contactsense.calibration.parameters import (
    GROUPS,
    INERTIA_ERROR,
    OF_LINK_SENSORS,
    Entry,
    Group,
    entries,
    value,
)
from contactsense.calibration.residuals.equations import all_residuals, measured_channels
from contactsense.calibration.residuals.recording_residuals import (
    friction,
    sample_time,
    settled_samples,
    timing_variance_and_inertia_torque,
)
from contactsense.calibration.result import Calibration, Value, residual_statistics, scene_of
from contactsense.calibration.torque_signal_meaning import compare_meanings, setting_warnings
from contactsense.robots.files.file_model import FieldError
from contactsense.scene import Scene, check_scene
from contactsense.sensors.settings import CURRENTS

_MAX_REFITS = 6
"""Fits after which contacts are left out as they are, even if they still change."""
_UNCHANGED = 0.1
"""The contacts are final when the next fit moves their ends by less than this in all [s]."""
_MIN_SECONDS = 2.0
"""Shortest recording, and least contact-free motion in all of them [s]."""
_MIN_FREE = 0.5
"""Least fraction of contact-free motion: the median residual must be one without contact."""
_AT_REST = 0.01
"""A joint that stays within this range rests [rad]."""


class CalibrationError(ValueError):
    """The recordings cannot be used for calibration; the message gives the reason and a remedy."""


@dataclass(frozen=True)
class Settings:
    """Which parameters are estimated, and how."""

    groups: tuple[Group, ...]
    """Groups of parameters to estimate."""
    inertia_error: float = INERTIA_ERROR
    """Relative standard deviation of the links' masses about the robot's data."""
    widths: bool = True
    """Whether the velocities of the smooth sign functions of friction are estimated too."""
    leave_out_contacts: bool = True
    """Whether stretches in which something seems to push on the arm are left out."""


def default_groups(scene: Scene, recordings: list[FreeMotion]) -> tuple[Group, ...]:
    """Groups that can be estimated with these sensors, except the links' inertia, which must be requested."""
    groups: list[Group] = ["payload"]
    torque = scene.joint_torque
    if torque is not None and any(recording.torque is not None for recording in recordings):
        groups += ["bias"]
        if torque.contains != "external":
            groups += ["coulomb", "viscous", "rotor", "load", "lubricant"]
            groups += ["gain"] if torque.signal in CURRENTS else []
    if scene.base_wrench is not None and any(recording.reading is not None for recording in recordings):
        groups += ["wrench_bias", "tilt", "turn", "shift", "delay"]
    if any(recording.link_readings for recording in recordings):
        groups += OF_LINK_SENSORS
    return tuple(group for group in GROUPS if group in groups)


def calibrate(
    scene: Scene,
    recordings: list[FreeMotion],
    settings: Settings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Estimate the identifiable parameters from contact-free motion, and build a scene with them.

    Args:
        scene: Arm, sensors and prior values.
        recordings: Contact-free motion; the scene's sensors are used where a recording has them.
        settings: What to estimate; None: `default_groups`.
        progress: Called with the name of the next stage.

    Raises:
        CalibrationError: nothing can be estimated from these recordings.
        TypeError: `scene` or `recordings` is of another type.
    """
    check_scene(scene)
    check_recordings(recordings)
    _check(scene, recordings)
    settings = settings or Settings(default_groups(scene, recordings))
    start = CalibrationModel.of(scene)
    selected = entries(start, settings.groups, settings.inertia_error)
    fitted, recordings, contacts = _fit_without_contacts(start, recordings, selected, settings, progress)
    bodies = possible_bodies(fitted, selected, start)
    arm = bodies.arm
    progress("noise and model error")
    usable = [_settled_and_usable(recording, scene.bandwidth) for recording in recordings]
    before, after = (
        [all_residuals(x, s, scene.bandwidth)[rows] for s, rows in zip(recordings, usable, strict=True)]
        for x in (start, arm)
    )
    unconstrained = after
    if bodies.changed:
        unconstrained = [
            all_residuals(fitted.arm, s, scene.bandwidth)[rows]
            for s, rows in zip(recordings, usable, strict=True)
        ]
    measured = [measured_channels(scene, [recording]) for recording in recordings]
    noise_levels, wrenches = _noise(arm, recordings, usable, after, scene.bandwidth)
    values = _values(start, arm, fitted, selected)
    warnings = _warnings(scene, recordings, fitted, selected, noise_levels, progress)
    changed = {str(entry.group) for i, entry in enumerate(selected) if fitted.free[i] or i in fitted.at_zero}
    try:
        calibrated = scene_of(arm, changed, noise_levels, wrenches)
    except FieldError as error:
        first, part = error.issues[0], error.model.__name__.lower()
        name = f"{part}.{first['loc'][0]}" if first["loc"] else part
        raise CalibrationError(
            f"{recordings[0].name}: expected motion of the scene's arm, got a fit with {name} "
            f"{first['input']!r:.40}: `contactsense check` finds the wrong line or signal"
        ) from None
    return Calibration(
        scene=calibrated,
        values=tuple(v for v in values if v.entry.group != "links"),
        inertia=tuple(v for v in values if v.entry.group == "links"),
        warnings=warnings,
        before=residual_statistics(before, measured),
        after=residual_statistics(after, measured),
        unconstrained=residual_statistics(unconstrained, measured),
        constrained=tuple(scene.robot.link_names[k] for k in bodies.changed),
        condition=fitted.condition,
        covariance=fitted.covariance,
        contacts=contacts,
        seconds=sum(_usable_seconds(recording) for recording in recordings),
    )


def _values(
    start: CalibrationModel, arm: CalibrationModel, fitted: FittedModel, selected: tuple[Entry, ...]
) -> tuple[Value, ...]:
    """Each selected parameter before and after."""
    std = np.sqrt(np.diag(fitted.covariance))
    return tuple(
        Value(entry, value(start, entry), value(arm, entry), float(std[i]), fitted.kept.get(i, ""))
        for i, entry in enumerate(selected)
    )


def _warnings(
    scene: Scene,
    recordings: list[FreeMotion],
    fitted: FittedModel,
    selected: tuple[Entry, ...],
    noise_levels: NoiseLevels | None,
    progress: Callable[[str], None],
) -> tuple[str, ...]:
    """What the user should know: settings that the torques contradict, parameters that kept their value, and
    joints whose friction at rest was not seen."""
    kept = [
        f"{selected[i].name}: {why}"
        for i, why in (fitted.kept | fitted.at_zero).items()
        if selected[i].group != "links"
    ]
    if scene.joint_torque is None or noise_levels is None:
        return tuple(kept)
    progress("meaning of the torque signal")
    contradicted = setting_warnings(scene, compare_meanings(scene, recordings, scene.bandwidth))
    never_stopped = [
        f"{joint.name} never stopped or reversed: its uncertainty there is derived from Coulomb friction"
        for joint, rest in zip(scene.robot.joints, noise_levels.rest_error, strict=True)
        if np.isnan(rest)
    ]
    return (*contradicted, *kept, *never_stopped)


def _fit_without_contacts(
    start: CalibrationModel,
    recordings: list[FreeMotion],
    selected: tuple[Entry, ...],
    settings: Settings,
    progress: Callable[[str], None],
) -> tuple[FittedModel, list[FreeMotion], tuple[SuspectedContact, ...]]:
    """Fit, leave out what looks like a contact, and fit again until nothing changes."""
    bandwidth = start.scene.bandwidth
    contacts: tuple[SuspectedContact, ...] = ()
    given = recordings
    if settings.leave_out_contacts:
        recordings = _as_the_scene_sees_them(start, given)
    for _ in range(_MAX_REFITS):
        fitted = _fit(start, recordings, selected, settings, progress)
        if not settings.leave_out_contacts:
            return fitted, recordings, ()
        progress("contacts")
        quiet = trimmed_fit(fitted.arm, start, given, selected, fitted.free)
        found = [
            suspected_contacts(quiet.arm, recording, bandwidth, uncertainty)
            for recording, uncertainty in zip(recordings, quiet.uncertainty, strict=True)
        ]
        contacts = tuple(contact for _, stretches in found for contact in stretches)
        refined = [replace(r, free=r.usable & free) for r, (free, _) in zip(given, found, strict=True)]
        changed = sum(
            r.seconds * float(np.mean(r.usable != new.usable))
            for r, new in zip(recordings, refined, strict=True)
        )
        if changed < _UNCHANGED:
            return fitted, recordings, contacts
        _check_rest(given, refined, contacts)
        recordings = refined
    return _fit(start, recordings, selected, settings, progress), recordings, contacts


def _as_the_scene_sees_them(start: CalibrationModel, recordings: list[FreeMotion]) -> list[FreeMotion]:
    """The recordings without what looks like a contact under the scene's own values, where enough is left.

    A first fit to everything may lean so far towards pushes that it never finds them: where few joints move,
    hardly anything else determines the parameters.
    """
    found = [suspected_contacts(start, recording, start.scene.bandwidth) for recording in recordings]
    refined = [replace(r, free=r.usable & free) for r, (free, _) in zip(recordings, found, strict=True)]
    return refined if _enough_rest(recordings, refined) else recordings


def _fit(
    start: CalibrationModel,
    recordings: list[FreeMotion],
    selected: tuple[Entry, ...],
    settings: Settings,
    progress: Callable[[str], None],
) -> FittedModel:
    try:
        return fit_model(start, recordings, selected, settings.widths, progress)
    except np.linalg.LinAlgError:
        paths = [np.ptp(recording.q[recording.usable], axis=0) for recording in recordings]
        still = np.max(paths, axis=0) < _AT_REST
        names = [joint.name for joint, rests in zip(start.scene.robot.joints, still, strict=True) if rests]
        raise CalibrationError(
            "expected motion that determines the parameters, got too little: let every joint move"
            + (f"; at rest throughout: {', '.join(names)}" if names else "")
        ) from None


def _check_rest(
    given: list[FreeMotion], refined: list[FreeMotion], contacts: tuple[SuspectedContact, ...]
) -> None:
    """Refuse recordings with too little motion without contact."""
    if not _enough_rest(given, refined):
        total, rest = sum(map(_usable_seconds, given)), sum(map(_usable_seconds, refined))
        first = contacts[0]
        raise CalibrationError(
            f"{first.recording}: expected motion without contact, but something seems to push on the arm in "
            f"{total - rest:.1f} of {total:.1f} s, first at {first.start:.1f} s (row {first.first_row}); "
            "record again with nothing touching it"
        )


def _enough_rest(given: list[FreeMotion], refined: list[FreeMotion]) -> bool:
    """Whether enough of the motion that was given is left without contacts."""
    total = sum(map(_usable_seconds, given))
    return sum(map(_usable_seconds, refined)) >= max(_MIN_SECONDS, _MIN_FREE * total)


def _usable_seconds(recording: FreeMotion) -> float:
    return recording.seconds * float(np.mean(recording.usable))


def _settled_and_usable(recording: FreeMotion, bandwidth: float) -> np.ndarray:
    rows = recording.usable.copy()
    rows[: settled_samples(recording, bandwidth)] = False
    return rows


def _check(scene: Scene, recordings: list[FreeMotion]) -> None:
    if not recordings:
        raise CalibrationError("expected at least one recording of contact-free motion, got none")
    joints = len(scene.robot.joints)
    for recording in recordings:
        if recording.q.shape[1] != joints:
            raise CalibrationError(
                f"{recording.name}: expected {joints} joints, as {scene.robot.name} has, "
                f"got {recording.q.shape[1]}"
            )
        if recording.seconds < _MIN_SECONDS:
            raise CalibrationError(
                f"{recording.name}: expected at least {_MIN_SECONDS:g} s, got {recording.seconds:.2g} s"
            )
        if recording.torque is None and recording.reading is None:
            raise CalibrationError(
                f"{recording.name}: expected joint torques or base wrenches as in the scene, got neither"
            )
        if unknown := ", ".join(sorted(set(recording.link_readings) - set(scene.link_sensors))):
            raise CalibrationError(
                f"{recording.name}: link_readings: expected fields of the scene's sensors within the arm "
                f"({', '.join(scene.link_sensors) or 'it has none'}), got {unknown}"
            )
    usable = sum(map(_usable_seconds, recordings))
    if usable < _MIN_SECONDS:
        raise CalibrationError(f"free: expected at least {_MIN_SECONDS:g} s of use, got {usable:.2g} s")


def _noise(
    arm: CalibrationModel,
    recordings: list[FreeMotion],
    usable: list[np.ndarray],
    residual: list[np.ndarray],
    bandwidth: float,
) -> tuple[NoiseLevels | None, dict[str, tuple[float, float]]]:
    """Noise and model error of the joints; and force and moment noise of each force/torque sensor, by field,
    which includes its model error."""
    joints = len(arm.gain)
    noise_levels = None
    parts = list(zip(recordings, usable, residual, strict=True))
    with_torque = [(s, rows, r[:, :joints]) for s, rows, r in parts if s.torque is not None]
    if with_torque:
        residuals = []
        for s, rows, r in with_torque:
            timing_variance, inertia_torque = timing_variance_and_inertia_torque(arm, s, bandwidth)
            residuals.append(
                JointResiduals(
                    r,
                    s.qd[rows],
                    friction(arm, s)[rows],
                    timing_variance[rows],
                    inertia_torque[rows],
                    sample_time(s),
                )
            )
        noise_levels = estimate_noise(residuals, bandwidth)
    wrenches = {}
    for number, field in enumerate(("base_wrench", *arm.scene.link_sensors)):
        first = joints + 6 * number
        read = [part for part in parts if field in part[0].readings]
        own = [
            wrench_residuals(arm, s, rows, r[:, first : first + 6], field, bandwidth) for s, rows, r in read
        ]
        if own:
            wrenches[field] = wrench_noise(own)
    return noise_levels, wrenches
