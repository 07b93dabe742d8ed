"""The way of one sample, compiled: poses, external parts, link hypotheses, explanations. Nothing is
allocated."""

import math

import numpy as np

from contactsense.arm import Arm
from contactsense.drive import unexplained
from contactsense.equations import (
    from_bodies,
    observe_in_bodies,
    observe_joints,
    observe_match,
    observe_wrench,
    observe_wrist_match,
)
from contactsense.follower import APART, PAUSE, QUIET, WAITED, learn, take_up, watch
from contactsense.isolation import Sensors, isolate
from contactsense.ldl import invert
from contactsense.locate import locate
from contactsense.memory import Memory
from contactsense.observer import GAIN
from contactsense.stiction import energy_beyond_rest
from contactsense.stream import BASE, MATCH, STEP, TORQUE, WRIST, WRIST_MATCH
from contactsense.tracker import NONE, PHASE
from kinematics.core import carry, dot6, move
from robots.arrays import copy
from robots.compiled import inlined_kernel


@inlined_kernel
def _place_wrist(arm: Arm, memory: Memory) -> None:
    """Momentum and weight of the tool, and where the wrist sensor is."""
    last = memory.motion.rotation.shape[0] - 1
    R, o = memory.motion.rotation[last], memory.motion.origin[last]
    carry(
        arm.tool_mass,
        arm.tool_com,
        arm.tool_inertia,
        R,
        o,
        memory.motion.twist[last],
        arm.gravity,
        memory.carried[0],
        memory.carried[1],
    )
    s = arm.wrist_origin
    for i in range(3):
        memory.wrist_origin[i] = o[i] + R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]


@inlined_kernel
def follow(
    arm: Arm,
    memory: Memory,
    bandwidth: float,
) -> None:
    """Advance the observers by the newest sample of a stream, of an arm that may move.

    Args:
        arm, memory: The scene's constants, and what samples change; after `contactsense.stream.arrive`. The
            external parts are left in it.
        bandwidth: Cut-off frequency [Hz].
    """
    motion, stream = memory.motion, memory.stream
    model, drive, reading = memory.model, memory.drive, memory.reading
    qd, torque, wrist_wrench, steps = stream.qd, stream.torque, stream.wrist_wrench, stream.steps
    move(model, stream.q, qd, arm.gravity, motion)
    _place_wrist(arm, memory)
    for i in range(6):
        reading[i] = stream.base_wrench[i] - memory.follower.bias[i]
    if steps[BASE] >= 0.0:
        observe_in_bodies(motion, reading, steps[BASE], bandwidth, memory.base)
    if steps[TORQUE] >= 0.0:
        observe_joints(
            model, drive, motion, qd, torque, steps[TORQUE], bandwidth, memory.joints, memory.unexplained
        )
    if steps[WRIST] >= 0.0:
        observe_wrench(
            memory.carried[0], memory.carried[1], wrist_wrench, steps[WRIST], bandwidth, memory.wrist
        )
    if steps[MATCH] >= 0.0:
        observe_match(model, drive, motion, qd, torque, reading, steps[MATCH], bandwidth, memory.match)
    if steps[WRIST_MATCH] >= 0.0:
        observe_wrist_match(
            motion, memory.carried, wrist_wrench, reading, steps[WRIST_MATCH], bandwidth, memory.wrist_match
        )
    watch(
        memory.follower,
        drive,
        motion,
        arm.sensors.base_covariance,
        arm.sensors.torque_variance,
        arm.bias_rate,
        stream.clock[STEP],
        bandwidth,
    )
    present(
        memory,
        memory.base.residual,
        memory.match.residual,
        memory.joints.residual,
        memory.wrist_match.residual,
        memory.wrist.residual,
    )


@inlined_kernel
def present(
    memory: Memory,
    base: np.ndarray,
    match: np.ndarray,
    joints: np.ndarray,
    wrist_match: np.ndarray,
    wrist: np.ndarray,
) -> None:
    """Leave residuals, those of the observers or their means, in `memory` as the external parts to explain.

    Args:
        memory: With the poses of this sample; its external parts are filled.
        base, match, joints, wrist_match, wrist: Residuals in the order of `Memory`'s observers.
    """
    matched = memory.stream.usable[MATCH] > 0.0
    wrist_matched = memory.stream.usable[WRIST_MATCH] > 0.0
    from_bodies(memory.motion, base, memory.body_wrench)
    copy(memory.body_wrench[0], memory.base_wrench)
    copy(joints, memory.torque)
    copy(wrist, memory.wrist_wrench)
    for j in range(joints.shape[0]):
        memory.seen_torque[j] = (
            dot6(memory.motion.screw[j], memory.base_wrench) + match[j] if matched else joints[j]
        )
    for i in range(6):
        memory.seen_wrist[i] = memory.base_wrench[i] + wrist_match[i] if wrist_matched else wrist[i]


@inlined_kernel
def residual_gain(memory: Memory, present: tuple[bool, bool, bool]) -> float:
    """Variance of the observers' residuals over that of one sample's noise. A sensor that has missed a sample
    passes a little more of it: of those that are `present` the noisiest counts."""
    scale = 0.0
    if present[0]:
        scale = max(scale, memory.base.clock[GAIN])
    if present[1]:
        scale = max(scale, memory.joints.clock[GAIN])
    if present[2]:
        scale = max(scale, memory.wrist.clock[GAIN])
    return scale


@inlined_kernel
def energy_of_nothing(
    arm: Arm, memory: Memory, has_base: bool, has_torque: bool, has_wrist: bool, scale: float
) -> float:
    """Energy of "nothing touches": half the sum of squares of the external parts in units of their noise.

    Arguments as for `explain`.
    """
    tell(arm, memory, scale)
    energy = 0.0
    if has_torque:
        for j in range(memory.torque.shape[0]):
            energy += 0.5 * memory.torque[j] ** 2 / memory.torque_variance[j]
    if has_base:
        for i in range(6):
            row = dot6(memory.base_information[i], memory.base_wrench)
            energy += 0.5 * memory.base_wrench[i] * row / scale
    if has_wrist:
        s, w = memory.wrist_origin, memory.wrist_wrench
        force, moment = arm.sensors.wrist_variance[0] * scale, arm.sensors.wrist_variance[1] * scale
        energy += 0.5 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2) / force
        energy += (
            0.5
            * (
                (w[3] - s[1] * w[2] + s[2] * w[1]) ** 2
                + (w[4] - s[2] * w[0] + s[0] * w[2]) ** 2
                + (w[5] - s[0] * w[1] + s[1] * w[0]) ** 2
            )
            / moment
        )
    return energy


@inlined_kernel
def tell(arm: Arm, memory: Memory, scale: float) -> None:
    """Fill in the covariances of the external parts: noise times `scale`, and what is not known of the
    arm."""
    sensors, follower = arm.sensors, memory.follower
    for j in range(memory.torque.shape[0]):
        known = sensors.torque_variance[j] * scale + memory.unexplained[j] ** 2
        memory.torque_variance[j] = known + follower.torque[j]
    unknown = 0.0
    for i in range(6):
        unknown += follower.base[i, i]
        for k in range(6):
            memory.base_covariance[i, k] = sensors.base_covariance[i, k] + follower.base[i, k] / scale
    # A covariance without a trace is none.
    if unknown > 0.0:
        invert(memory.base_covariance, memory.base_information)
    else:
        for i in range(6):
            copy(sensors.base_information[i], memory.base_information[i])


@inlined_kernel
def watch_rest(
    arm: Arm, memory: Memory, scale: float, limits: tuple[float, float], bandwidth: float
) -> float:
    """Energy of "nothing touches" by what has changed since the arm rests (`contactsense.stiction`), of
    torques alone.

    Args:
        arm, memory: After `follow` for this sample.
        scale, limits, bandwidth: As for `energy_beyond_rest`.
    """
    energy: float = energy_beyond_rest(
        memory.stiction,
        memory.drive,
        memory.stream.q,
        memory.torque,
        arm.sensors.torque_variance,
        scale,
        memory.follower.torque,
        memory.stream.steps[TORQUE],
        memory.track.life[PHASE] != NONE,
        limits,
        bandwidth,
    )
    return energy


@inlined_kernel
def follow_unknown(
    arm: Arm, memory: Memory, has_base: bool, has_torque: bool, scale: float, bandwidth: float
) -> None:
    """Learn from the residuals of an arm that nothing touches what is not known of sensors and masses.

    Residuals are an Ornstein-Uhlenbeck process: taken some way apart, each counts a little less than a sample
    of white noise would.

    Args:
        arm, memory: After `follow` and `energy_of_nothing` for this sample.
        has_base, has_torque: Which residuals can be used.
        scale: Factor on the variances of the scene's noise.
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    follower, n = memory.follower, memory.torque.shape[0]
    K = 2.0 * math.pi * bandwidth
    if follower.clock[WAITED] * K < APART or follower.clock[QUIET] * K < PAUSE:
        return
    alike = math.exp(-K * follower.clock[WAITED])
    counts = (1.0 + alike) / (1.0 - alike)
    follower.clock[WAITED] = 0.0
    if has_torque:
        for j in range(n):
            variance = arm.sensors.torque_variance[j] * scale + memory.unexplained[j] ** 2
            learn(follower, j, n, memory.joints.residual[j], variance * counts)
    if has_base:
        for i in range(6):
            variance = arm.sensors.base_covariance[i, i] * scale
            learn(follower, n + i, n, memory.base_wrench[i], variance * counts)
    take_up(
        follower,
        memory.model,
        memory.drive,
        memory.motion,
        bandwidth,
        memory.base,
        memory.match,
        memory.joints,
        memory.wrist_match,
    )
    for j in range(n):
        for k in range(memory.stiction.level.shape[0]):
            memory.stiction.level[k, j] += memory.joints.residual[j] - memory.torque[j]


@inlined_kernel
def rest(
    arm: Arm,
    memory: Memory,
    q: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    external: bool,
) -> None:
    """Take one sample of an arm at rest: poses, and the external parts, which are left in `memory`.

    With `external` the measurements have the arm's own part taken off already; the joint torques keep the
    actuator's sign, so that a contact wrench w adds -s_j . w to them.
    """
    motion = memory.motion
    move(arm.model, q, memory.rest, arm.gravity, motion)
    _place_wrist(arm, memory)
    for j in range(q.shape[0]):
        own = arm.drive.bias[j] - arm.drive.gravity * dot6(motion.screw[j], motion.gravity[j + 1])
        memory.torque[j] = (0.0 if external else own) - torque[j]
        memory.unexplained[j] = unexplained(arm.drive, j, 0.0, 0.0)
    for i in range(6):
        memory.base_wrench[i] = base_wrench[i] - (0.0 if external else motion.gravity[0, i])
        memory.wrist_wrench[i] = wrist_wrench[i] - (0.0 if external else memory.carried[1, i])
    memory.follower.base[:] = 0.0
    memory.follower.torque[:] = 0.0
    for body in range(memory.body_wrench.shape[0]):
        copy(memory.base_wrench, memory.body_wrench[body])
    copy(memory.torque, memory.seen_torque)
    copy(memory.wrist_wrench, memory.seen_wrist)


@inlined_kernel
def explain(
    arm: Arm,
    memory: Memory,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    scale: float,
    gate: bool,
    threshold: float,
) -> tuple[int, float]:
    """Explain the external parts in `memory` by a contact.

    Args:
        arm: The scene's constants.
        memory: With poses and external parts; explanations are left in `found` and `link_probability`.
        has_base, has_torque, has_wrist: Which sensors have a value.
        scale: Factor on all variances of the scene's noise.
        gate: Decide for the link of the best evidence first and look for the place on that link only.
        threshold: If "nothing touches" has no more energy than this, no explanation is looked for.

    Returns:
        Number of explanations, and the energy of "nothing touches": half the sum of squares in units of the
        noise.
    """
    tell(arm, memory, scale)
    known = arm.sensors
    isolate(
        Sensors(
            known.depth,
            known.beyond_wrist,
            memory.base_covariance,
            memory.base_information,
            known.torque_variance,
            known.wrist_variance,
        ),
        memory.motion.screw,
        memory.base_wrench,
        has_base,
        memory.torque,
        memory.seen_torque,
        memory.torque_variance,
        has_torque,
        memory.wrist_wrench,
        memory.seen_wrist,
        has_wrist,
        memory.wrist_origin,
        scale,
        memory.hypotheses,
    )
    # A contact on the base link is seen by the base sensor alone: the joints' part of its energy is that of
    # no contact.
    nothing = memory.hypotheses.energy[0]
    if has_base:
        for i in range(6):
            row = dot6(memory.base_information[i], memory.base_wrench)
            nothing += 0.5 * memory.base_wrench[i] * row / scale
        for link in range(1, arm.touchable.shape[0]):
            for i in range(6):
                memory.hypotheses.wrench[link, i] += (
                    memory.body_wrench[arm.sensors.depth[link], i] - memory.base_wrench[i]
                )
    if nothing <= threshold:
        return 0, nothing
    best = -1
    for link in range(arm.touchable.shape[0]):
        memory.open[link] = 0 if gate else arm.touchable[link]
        if arm.touchable[link] and (
            best < 0 or memory.hypotheses.log_evidence[link] > memory.hypotheses.log_evidence[best]
        ):
            best = link
    if best >= 0:
        memory.open[best] = 1
    count = locate(
        arm.surfaces,
        arm.places,
        arm.parts,
        memory.open,
        arm.sensors.depth,
        memory.motion,
        memory.hypotheses,
        has_base,
        arm.prior,
        memory.work,
        memory.cells,
        memory.found,
        memory.link_probability,
    )
    return count, nothing
