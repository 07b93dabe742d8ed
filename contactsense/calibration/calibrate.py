"""Calibration from contact-free motion: estimate the identifiable parameters of arm and sensors."""

from collections.abc import Callable

import numpy as np

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.contact_free_fit import (
    CalibrationError,
    Settings,
    fit_without_contacts,
    usable_seconds,
)
from contactsense.calibration.fit.gauss_newton import FittedModel
from contactsense.calibration.fit.possible_bodies import possible_bodies
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.noise.noise_estimation import JointResiduals, NoiseLevels, estimate_noise
from contactsense.calibration.noise.wrench_noise import wrench_noise, wrench_residuals
from contactsense.calibration.parameters import Entry, value
from contactsense.calibration.residuals.equations import all_residuals, measured_channels
from contactsense.calibration.residuals.recording_residuals import (
    friction,
    sample_time,
    settled_samples,
    timing_variance_and_inertia_torque,
)
from contactsense.calibration.result import Calibration, Value, residual_statistics, scene_of
from contactsense.calibration.torque_signal_meaning import compare_meanings, setting_warnings
from contactsense.robots.files.field_errors import joined
from contactsense.robots.files.file_model import FieldError
from contactsense.scene import Scene


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
    found = fit_without_contacts(scene, recordings, settings, progress)
    start, selected, fitted, recordings = found.start, found.selected, found.fitted, found.recordings
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
        place, reason = next(iter(error.reasons.items()))
        name = joined((error.model.lower(), *place))
        raise CalibrationError(
            f"{recordings[0].name}: expected motion of the scene's arm, got a fit with {name} out of bounds "
            f"({reason}): `contactsense check` finds the wrong line or signal"
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
        contacts=found.contacts,
        seconds=sum(usable_seconds(recording) for recording in recordings),
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


def _settled_and_usable(recording: FreeMotion, bandwidth: float) -> np.ndarray:
    rows = recording.usable.copy()
    rows[: settled_samples(recording, bandwidth)] = False
    return rows


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
