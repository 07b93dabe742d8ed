"""A fit to contact-free motion that leaves out what looks like a contact.

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
from contactsense.calibration.free_motion import FreeMotion, check_recordings
from contactsense.calibration.parameters import (
    GROUPS,
    INERTIA_ERROR,
    OF_LINK_SENSORS,
    Entry,
    Group,
    entries,
)
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


class TooMuchContactError(CalibrationError):
    """Less than half of the motion is without contact."""

    def __init__(self, message: str, contacts: tuple[SuspectedContact, ...]) -> None:
        """`contacts`: the stretches in which something seems to push on the arm."""
        super().__init__(message)
        self.contacts = contacts


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


@dataclass(frozen=True)
class ContactFreeFit:
    """A model that was fitted to the motion without contact."""

    start: CalibrationModel
    """The scene's values."""
    selected: tuple[Entry, ...]
    """The parameters."""
    fitted: FittedModel
    recordings: list[FreeMotion]
    """As they were given; `usable` leaves out the contacts."""
    contacts: tuple[SuspectedContact, ...]


def fit_without_contacts(
    scene: Scene,
    recordings: list[FreeMotion],
    settings: Settings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> ContactFreeFit:
    """Fit, leave out what looks like a contact, and fit again until nothing changes.

    Arguments and errors as for `contactsense.calibration.calibrate.calibrate`; among the latter
    `TooMuchContactError`.
    """
    check_scene(scene)
    check_recordings(recordings)
    _check(scene, recordings)
    settings = settings or Settings(default_groups(scene, recordings))
    start = CalibrationModel.of(scene)
    selected = entries(start, settings.groups, settings.inertia_error)
    found = _fit_without_contacts(start, recordings, selected, settings, progress)
    return ContactFreeFit(start, selected, *found)


def _fit_without_contacts(
    start: CalibrationModel,
    recordings: list[FreeMotion],
    selected: tuple[Entry, ...],
    settings: Settings,
    progress: Callable[[str], None],
) -> tuple[FittedModel, list[FreeMotion], tuple[SuspectedContact, ...]]:
    """The fit, the recordings, and the contacts of `ContactFreeFit`."""
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
        total, rest = sum(map(usable_seconds, given)), sum(map(usable_seconds, refined))
        first = contacts[0]
        raise TooMuchContactError(
            f"{first.recording}: expected motion without contact, but something seems to push on the arm in "
            f"{total - rest:.1f} of {total:.1f} s, first at {first.start:.1f} s (row {first.first_row}); "
            "record again with nothing touching it",
            contacts,
        )


def _enough_rest(given: list[FreeMotion], refined: list[FreeMotion]) -> bool:
    """Whether enough of the motion that was given is left without contacts."""
    total = sum(map(usable_seconds, given))
    return sum(map(usable_seconds, refined)) >= max(_MIN_SECONDS, _MIN_FREE * total)


def usable_seconds(recording: FreeMotion) -> float:
    """Duration of the samples of a recording that are used [s]."""
    return recording.seconds * float(np.mean(recording.usable))


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
    usable = sum(map(usable_seconds, recordings))
    if usable < _MIN_SECONDS:
        raise CalibrationError(f"free: expected at least {_MIN_SECONDS:g} s of use, got {usable:.2g} s")
