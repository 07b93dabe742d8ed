"""Jacobian of the residuals of a recording with respect to the parameters.

Except for the links' inertial parameters, every column is a finite difference of the observer's residuals:
nearly all parameters enter linearly, so one large step is exact, and the observer's equations are not
duplicated. The sixty columns of the links come from the regressor in one pass.

Residuals are in the frame of the force/torque sensor as it is estimated, and derivatives keep that frame. So
those by its place follow from the measured force. Derivatives of the residual itself would follow from the
force by the model, with the noise of the velocities, which is in the residual too: a fit would move the
sensor to where that is smaller. The noise of the measured force is not in the moments of this residual, so
neither noise biases the place: the measured force is an instrumental variable (T. Soederstroem, P. Stoica,
"Instrumental variable methods for system identification", 1983). Those by the orientation follow from the
wrench by the model: the measured one has the residual's own noise, and of an arm at rest, whose wrench tells
nothing of the orientation, that noise alone would seem to. Those by masses, of the tool and of the links, by
the orientation and by the delay are derivatives of the residuals of a smooth motion
(`contactsense.calibration.residuals.smooth_velocities`), except in the joint torques, whose own noise is
larger.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import PER_JOINT, Entry, Group, apply_step
from contactsense.calibration.residuals.recording_residuals import (
    GAP,
    Dynamics,
    JointMotion,
    recently_moved,
    residuals,
    sample_time,
    samples_of_rows,
    time_step,
)
from contactsense.calibration.residuals.smooth_velocities import is_smooth, with_smooth_velocities
from contactsense.kinematics.model import empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.regressor import PARAMETERS, arm_regressor
from contactsense.residuals.momentum_observer import (
    MomentumObserver,
    advance_all,
    empty_observer,
    start_step,
)
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.kernel import kernel

DIFFERENCE_STEPS: dict[Group, float] = {"tilt": 1e-5, "payload": 1e-3}
"""Steps for parameters that enter nonlinearly, in units of their prior standard deviation."""

_OF_THE_MOTION: tuple[Group, ...] = ("payload", "turn", "delay", "links")
"""Groups whose derivatives in the equations of the base sensor are those of smoothed velocities."""

_START = 15.0
"""Time constants of the observer until a whole weight, from which it starts, changes by less than a slow
motion."""


@dataclass(frozen=True)
class Rows:
    """Residuals of one equation over one recording, and their derivatives. N samples, k parameters."""

    channel: int
    """Index of the joint, n + 0..5 for the base wrench, or then six for each sensor within the arm."""
    residual: np.ndarray
    """Shape (N,) [Nm, or N and Nm]."""
    columns: np.ndarray
    """Indices of the parameters that it contains, shape (k,)."""
    slope: np.ndarray
    """Derivatives of the residual, shape (N, k)."""
    moving: np.ndarray
    """Whether the row counts: nothing touched the arm, and the joint has moved recently, so that its friction
    is known, shape (N,), bool."""
    dt: float
    """Time between rows [s]."""

    @classmethod
    def of(
        cls,
        channel: int,
        residual: np.ndarray,
        slopes: list[tuple[int, np.ndarray]],
        moving: np.ndarray,
        dt: float,
    ) -> Self:
        """Rows with the derivatives, shape (N,) each, by the parameters of these indices."""
        columns = np.array([number for number, _ in slopes], dtype=np.int64)
        slope = np.array([slope for _, slope in slopes]).reshape(len(slopes), len(residual)).T.copy()
        return cls(channel, residual, columns, slope, moving, dt)


def linearize(
    arm: CalibrationModel, recording: FreeMotion, selected: tuple[Entry, ...], bandwidth: float
) -> list[Rows]:
    """Residuals and derivatives of the equations of joints and base sensor over a recording.

    Args:
        arm: Point of linearization.
        recording: Contact-free motion.
        selected: The parameters.
        bandwidth: Cut-off frequency of the observer [Hz].
    """
    joints = recording.q.shape[1]
    residual = residuals(arm, recording, bandwidth)

    def residual_of(x: CalibrationModel, part: FreeMotion) -> np.ndarray:
        return residuals(x, part, bandwidth, about=arm)

    keep = samples_of_rows(recording, bandwidth)
    smooth, of_smooth = recording, residual
    if recording.reading is not None and any(entry.group in _OF_THE_MOTION for entry in selected):
        smooth = with_smooth_velocities(recording)
        of_smooth = residuals(arm, smooth, bandwidth)
    slopes: list[tuple[int, np.ndarray, int | None]] = []
    done: set[Group] = set()
    for number, entry in enumerate(selected):
        if entry.group == "links" or entry.sensor is not None:
            continue
        if recording.reading is None and entry.in_base_only:
            continue
        if entry.group in PER_JOINT:
            if entry.group in done or recording.torque is None:
                continue
            done.add(entry.group)
            slopes += _joint_columns(arm, recording, selected, entry.group, bandwidth, residual, keep)
        else:
            slope = difference(residual_of, arm, recording, entry, residual)
            if entry.group in _OF_THE_MOTION and smooth is not recording:
                of_motion = difference(residual_of, arm, smooth, entry, of_smooth)
                # A delay acts by the change of the accelerations, which is wrong near the ends.
                where = is_smooth(recording) if entry.group == "delay" else slice(None)
                slope[where, joints:] = of_motion[where, joints:]
            slopes.append((number, slope[keep], None))
    links = [(number, entry.index) for number, entry in enumerate(selected) if entry.group == "links"]
    if links:
        by_link = inertial_columns(arm, recording, arm.gravity, bandwidth, keep)
        if smooth is not recording:
            by_link[:, joints:] = inertial_columns(arm, smooth, arm.gravity, bandwidth, keep)[:, joints:]
        by_link[:, joints:] = np.einsum("ij,mjlp->milp", arm.to_base_sensor, by_link[:, joints:])
        slopes += [(number, by_link[:, :, link, column], None) for number, (link, column) in links]
    return _rows(recording, residual[keep], slopes, keep)


def _rows(
    recording: FreeMotion, residual: np.ndarray, slopes: list[tuple[int, np.ndarray, int | None]], keep: slice
) -> list[Rows]:
    """The rows of each channel that was recorded.

    Args:
        recording: Contact-free motion.
        residual: Residuals of the samples `keep`, shape (N, n + 6).
        slopes: For each parameter its number, its derivatives, of the same shape, and the only channel that
            it changes, if it is one.
        keep: Which samples are used.
    """
    joints = recording.q.shape[1]
    moving = recently_moved(recording)[keep]
    usable = recording.usable[keep]
    dt = keep.step * sample_time(recording)
    rows = []
    for channel in range(joints + 6):
        if (recording.torque if channel < joints else recording.reading) is None:
            continue
        own = [
            (number, slope[:, channel]) for number, slope, only in slopes if only is None or only == channel
        ]
        own = [(number, column) for number, column in own if np.any(column)]
        counts = usable & moving[:, channel] if channel < joints else usable
        rows.append(Rows.of(channel, residual[:, channel], own, counts, dt))
    return rows


def difference(
    residual_of: Callable[[CalibrationModel, FreeMotion], np.ndarray],
    arm: CalibrationModel,
    recording: FreeMotion,
    entry: Entry,
    residual: np.ndarray,
) -> np.ndarray:
    """Derivative of residuals by one parameter, by a finite difference; shape as theirs.

    Args:
        residual_of: Residuals of an arm, for a recording.
        arm: Point of linearization.
        recording: Contact-free motion.
        entry: The parameter.
        residual: `residual_of(arm, recording)`.
    """
    if entry.group in ("delay", "link_delay"):
        # The rate of the readings' own noise exceeds that of slow motion many times, and would seem to
        # exclude any delay. The model's readings have no noise: what remains of readings that are zero, with
        # the opposite sign.
        rate = -np.gradient(residual_of(arm, _silent(arm, recording)), recording.t, axis=0)
        rate[_starting(recording.t, arm.scene.bandwidth)] = 0.0
        return np.asarray(rate)
    if entry.group in ("turn", "link_turn"):
        # The filter works in base axes: this neglects how far a sensor within the arm turns meanwhile.
        slope = np.zeros_like(residual)
        model, axis = residual_of(arm, _silent(arm, recording)), _axis(arm, entry)
        for part in (slice(-6, -3), slice(-3, None)):
            slope[:, part] = np.cross(model[:, part], axis)
        return slope
    h = entry.prior_std * DIFFERENCE_STEPS.get(entry.group, 1.0)
    changed = apply_step(arm, [entry], np.array([h]))
    return np.asarray((residual_of(changed, recording) - residual) / h)


def _silent(arm: CalibrationModel, recording: FreeMotion) -> FreeMotion:
    """The recording with sensors that measure nothing: what remains is the model with the opposite sign."""
    known = {"base_wrench": arm.wrench_bias, **dict(zip(arm.scene.link_sensors, arm.link_bias, strict=True))}
    nothing = {field: np.tile(known[field], (len(x), 1)) for field, x in recording.readings.items()}
    return replace(recording.with_readings(nothing), torque=None)


def _axis(arm: CalibrationModel, entry: Entry) -> np.ndarray:
    """Axis about which a parameter of a sensor's orientation turns its readings, in the axes of the
    residuals, shape (3,); its length is the angle per unit."""
    turn = arm.turn if entry.sensor is None else arm.link_turn[entry.index[0]]
    now, h = Rotation.from_rotvec(turn), 1e-5
    axis = (Rotation.from_rotvec(turn + h * np.eye(3)[entry.index[-1]]) * now.inv()).as_rotvec() / h
    if entry.sensor is None:
        return np.asarray(axis)
    # The residual of a sensor within the arm is in its own frame.
    return np.asarray((now.as_matrix() @ arm.scene.link_sensors[entry.sensor].rotation).T @ axis)


def _starting(t: np.ndarray, bandwidth: float) -> np.ndarray:
    """Which samples at times t, shape (N,) [s], show more of the observer's start, or of its next one after a
    gap, than of the motion, shape (N,), bool."""
    gap = np.diff(t) > GAP
    start = np.maximum.accumulate(np.where(np.append(True, gap), t, -np.inf))
    starting = t - start < _START / (2.0 * np.pi * bandwidth)
    return np.asarray(starting | np.append(gap, False))


def _joint_columns(
    arm: CalibrationModel,
    recording: FreeMotion,
    selected: tuple[Entry, ...],
    group: Group,
    bandwidth: float,
    residual: np.ndarray,
    keep: slice,
) -> list[tuple[int, np.ndarray, int | None]]:
    """Columns of a group for all joints in one pass, as each joint's own parameters are in its own equation
    only."""
    own = [(number, entry) for number, entry in enumerate(selected) if entry.group == group]
    step = np.array([entry.prior_std for _, entry in own])
    shifted = residuals(apply_step(arm, [entry for _, entry in own], step), recording, bandwidth)
    found: list[tuple[int, np.ndarray, int | None]] = []
    for (number, entry), h in zip(own, step, strict=True):
        assert entry.joint is not None
        change = (shifted - residual) / h
        if group == "gain":
            # The model's torque instead of the measured one: noise in a regressor would bias the estimate
            # towards zero.
            change = change - residual / arm.gain[entry.joint]
        found.append((number, change[keep], entry.joint))
    return found


@kernel
def _observe_links(
    arm: Dynamics,
    joints: JointMotion,
    bandwidth: float,
    state: MomentumObserver,
    momentum: np.ndarray,
    drift: np.ndarray,
    scratch: np.ndarray,
    start: int,
    stride: int,
    out: np.ndarray,
) -> None:
    """The observer, applied to the columns of the regressor instead of momenta and drifts."""
    n, size = joints.q.shape[1], out.shape[1]
    row = 0
    for i in range(joints.t.shape[0]):
        step = start_step(state, time_step(joints.t, i), bandwidth)
        kinematics_and_momenta(arm.model, joints.q[i], joints.qd[i], arm.gravity, arm.motion)
        arm_regressor(
            arm.model, arm.motion, arm.gravity, arm.torque_model.gravity, arm.torque_model.inertia,
            momentum[:n], drift[:n], momentum[n:], drift[n:], scratch,
        )  # fmt: skip
        advance_all(state, momentum.reshape(size), drift.reshape(size), step)
        if i >= start and (i - start) % stride == 0:
            copy(state.residual, out[row])
            row += 1


def inertial_columns(
    arm: CalibrationModel, recording: FreeMotion, gravity: np.ndarray, bandwidth: float, keep: slice
) -> np.ndarray:
    """Derivatives of the residuals with respect to the inertial parameters of all links.

    Args:
        arm: Kinematics, and the contents of the torque signal.
        recording: Its motion is used, its readings are not.
        gravity: In base axes, shape (3,) [m/s^2]; the derivatives are affine in it.
        bandwidth: Cut-off frequency of the observer [Hz].
        keep: Samples to return, M of them.

    Returns:
        Shape (M, n + 6, n + 1, 10): n joints and the base wrench about the base origin, links, and the
        parameters of `contactsense.kinematics.regressor`.
    """
    joints = recording.q.shape[1]
    shape = (joints + 6, joints + 1, PARAMETERS)
    start, _, stride = keep.indices(len(recording.t))
    rows = len(range(*keep.indices(len(recording.t))))
    out = np.empty((rows, int(np.prod(shape))))
    _observe_links(
        Dynamics(arm.model, arm.torque_model, gravity, empty_motion(joints)),
        JointMotion(recording.t, recording.q, recording.qd),
        bandwidth, empty_observer(out.shape[1]), np.empty(shape), np.empty(shape), np.empty(3), start, stride,
        out,
    )  # fmt: skip
    return out.reshape(rows, *shape)
