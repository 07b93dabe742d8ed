"""The way of one sample, compiled: poses, external parts, link hypotheses, explanations. Nothing is
allocated."""

from typing import NamedTuple

import numpy as np

from contactsense.arm import Arm
from contactsense.isolation import Hypotheses, empty_hypotheses, isolate
from contactsense.locate import Candidates, empty_candidates, locate
from contactsense.observer import Observer, empty_observer, observe_joints, observe_wrench
from contactsense.refine import Work, empty_work
from kinematics.core import carry, dot6, move
from kinematics.model import Motion, empty_motion
from robots.compiled import kernel


class Memory(NamedTuple):
    """Everything that a sample changes: observers, and the arrays in which results are left."""

    motion: Motion
    hypotheses: Hypotheses
    found: Candidates
    work: Work
    link_probability: np.ndarray
    """Probability of each link, shape (links,)."""
    joints: Observer
    base: Observer
    wrist: Observer
    carried: np.ndarray
    """Momentum and gravity wrench of what the wrist sensor carries, shape (2, 6)."""
    wrist_origin: np.ndarray
    """Origin of the wrist sensor, base frame, shape (3,) [m]."""
    base_wrench: np.ndarray
    """External wrench on the base sensor, shape (6,) [N, Nm]."""
    torque: np.ndarray
    """External part of each joint's torque as s_j . w, shape (n,) [Nm]."""
    wrist_wrench: np.ndarray
    """External wrench on the wrist sensor, base axes, base origin, shape (6,) [N, Nm]."""
    rest: np.ndarray
    """Zero joint velocities, shape (n,)."""
    open: np.ndarray
    """Links among which the contact is sought, shape (links,), bool."""


def empty_memory(arm: Arm) -> Memory:
    """Memory before the first sample."""
    joints = arm.model.joints
    links = len(arm.touchable)
    return Memory(
        motion=empty_motion(joints),
        hypotheses=empty_hypotheses(links),
        found=empty_candidates(len(arm.surfaces.kind)),
        work=empty_work(),
        link_probability=np.zeros(links),
        joints=empty_observer(joints),
        base=empty_observer(6),
        wrist=empty_observer(6),
        carried=np.zeros((2, 6)),
        wrist_origin=np.zeros(3),
        base_wrench=np.zeros(6),
        torque=np.zeros(joints),
        wrist_wrench=np.zeros(6),
        rest=np.zeros(joints),
        open=np.zeros(links, dtype=bool),
    )


@kernel
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


@kernel
def follow(
    arm: Arm,
    memory: Memory,
    q: np.ndarray,
    qd: np.ndarray,
    torque: np.ndarray,
    torque_dt: float,
    base_wrench: np.ndarray,
    base_dt: float,
    wrist_wrench: np.ndarray,
    wrist_dt: float,
    bandwidth: float,
) -> None:
    """Advance the observers by a sample of a moving arm; a sensor with a negative dt has no value this time.

    The external parts are left in `memory`. Units and frames as in `contactsense.types.Sample`.
    """
    motion = memory.motion
    move(arm.model, q, qd, arm.gravity, motion)
    _place_wrist(arm, memory)
    if torque_dt >= 0.0:
        observe_joints(arm.model, motion, qd, torque, torque_dt, bandwidth, memory.joints)
    if base_dt >= 0.0:
        observe_wrench(motion.momentum[0], motion.gravity[0], base_wrench, base_dt, bandwidth, memory.base)
    if wrist_dt >= 0.0:
        observe_wrench(memory.carried[0], memory.carried[1], wrist_wrench, wrist_dt, bandwidth, memory.wrist)
    memory.torque[:] = memory.joints.residual
    memory.base_wrench[:] = memory.base.residual
    memory.wrist_wrench[:] = memory.wrist.residual


@kernel
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
        own = 0.0 if external else -dot6(motion.screw[j], motion.gravity[j + 1])
        memory.torque[j] = own - torque[j]
    for i in range(6):
        memory.base_wrench[i] = base_wrench[i] - (0.0 if external else motion.gravity[0, i])
        memory.wrist_wrench[i] = wrist_wrench[i] - (0.0 if external else memory.carried[1, i])


@kernel
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
    isolate(
        arm.sensors,
        memory.motion.screw,
        memory.base_wrench,
        has_base,
        memory.torque,
        has_torque,
        memory.wrist_wrench,
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
            row = dot6(arm.sensors.base_information[i], memory.base_wrench)
            nothing += 0.5 * memory.base_wrench[i] * row / scale
    if nothing <= threshold:
        return 0, nothing
    best = -1
    for link in range(arm.touchable.shape[0]):
        memory.open[link] = arm.touchable[link] and not gate
        if arm.touchable[link] and (
            best < 0 or memory.hypotheses.log_evidence[link] > memory.hypotheses.log_evidence[best]
        ):
            best = link
    if best >= 0:
        memory.open[best] = True
    count = locate(
        arm.surfaces,
        memory.open,
        arm.sensors.depth,
        memory.motion,
        memory.hypotheses,
        has_base,
        arm.prior,
        memory.work,
        memory.found,
        memory.link_probability,
    )
    return count, nothing


@kernel
def explain_batch(
    arm: Arm,
    memory: Memory,
    q: np.ndarray,
    torque: np.ndarray,
    has_torque: bool,
    base_wrench: np.ndarray,
    has_base: bool,
    wrist_wrench: np.ndarray,
    has_wrist: bool,
    external: bool,
    gate: bool,
    nothing: np.ndarray,
    link: np.ndarray,
    primitive: np.ndarray,
    probability: np.ndarray,
    link_probability: np.ndarray,
    point: np.ndarray,
    normal: np.ndarray,
    force: np.ndarray,
    torsion: np.ndarray,
    covariance: np.ndarray,
) -> None:
    """`rest` and `explain` for N samples; the best explanation of each goes into row i of the outputs, link
    -1 for none."""
    for i in range(q.shape[0]):
        rest(arm, memory, q[i], torque[i], base_wrench[i], wrist_wrench[i], external)
        count, nothing[i] = explain(arm, memory, has_base, has_torque, has_wrist, 1.0, gate, -1.0)
        link_probability[i] = memory.link_probability
        if count == 0:
            link[i] = -1
            primitive[i] = -1
            probability[i] = 0.0
            point[i] = 0.0
            normal[i] = 0.0
            force[i] = 0.0
            torsion[i] = 0.0
            covariance[i] = 0.0
            continue
        top = memory.found.order[0]
        link[i] = arm.surfaces.link[top]
        primitive[i] = top
        probability[i] = memory.found.probability[top]
        point[i] = memory.found.point[top]
        normal[i] = memory.found.normal[top]
        force[i] = memory.found.force[top]
        torsion[i] = memory.found.torsion[top]
        covariance[i] = memory.found.covariance[top]
