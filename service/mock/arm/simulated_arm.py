"""The simulated arm: computes sensor readings and ground truth from a script."""

from dataclasses import dataclass

import numpy as np

from contactsense import robots
from contactsense.robots import Robot
from contactsense.service.mock.arm.measured_velocity import measured_velocity
from contactsense.service.mock.arm.newton_euler import LinkLoad, inverse_dynamics, link_poses
from contactsense.service.mock.arm.script import Contact, Script, ScriptError, Trajectory
from contactsense.service.mock.arm.surface_check import check_contacts


@dataclass(frozen=True, slots=True)
class Touch:
    """Ground truth of one scripted contact. M is the number of samples during the contact."""

    link: str
    """Name of the touched link."""
    link_index: int
    """Number of the link (base: 0)."""
    point_link: np.ndarray
    """Contact point, link frame [m], shape (3,)."""
    start: float
    """Onset of the force [s]."""
    stop: float
    """End of the force [s]."""
    first: int
    """Number of its first sample."""
    point_base: np.ndarray
    """Contact point, base frame [m], shape (M, 3)."""
    force_base: np.ndarray
    """Force on the robot, base axes [N], shape (M, 3)."""
    torsion: np.ndarray
    """Moment on the robot about the outward normal [Nm], shape (M,)."""

    @property
    def last(self) -> int:
        """Number of its last sample."""
        return self.first + len(self.torsion) - 1


@dataclass(frozen=True, slots=True)
class Motion:
    """Sensor readings of the simulated arm over one run of its script. N samples, n joints."""

    robot: Robot
    """The arm."""
    rate: float
    """Samples per second [Hz]."""
    t: np.ndarray
    """Time from the beginning of the script [s], shape (N,)."""
    q: np.ndarray
    """Joint positions [rad], shape (N, n)."""
    qd: np.ndarray
    """Joint velocities, with noise [rad/s], shape (N, n)."""
    qdd: np.ndarray
    """Joint accelerations [rad/s^2], shape (N, n)."""
    joint_torque: np.ndarray
    """Torques that the actuators apply, with noise [Nm], shape (N, n)."""
    base_wrench: np.ndarray
    """Wrench of the arm on the sensor below it, with noise: force then moment about the base origin, base
    axes [N, Nm], shape (N, 6)."""
    touches: tuple[Touch, ...]
    """Ground truth of the contacts, in the order of the script."""

    @property
    def loops(self) -> bool:
        """Whether it ends where it began, so that it can be repeated."""
        return bool(np.all(np.abs(self.q[-1] - self.q[0]) < 1e-3))


def simulate(script: Script, robot: Robot | None = None) -> Motion:
    """Simulate a whole script.

    Args:
        script: Motion, contacts and noise.
        robot: The arm; None: the arm of the library that the script names.

    Raises:
        ScriptError: The script does not fit the robot: joints, their limits, links, their surface; or it has
            obstacles, which only the live simulation supports.
    """
    arm = robot if robot is not None else _load(script.robot)
    if script.obstacles:
        raise ScriptError(
            "obstacles: expected none, since what they do to the motion is not known beforehand: "
            "`contactsense mock --script` simulates them"
        )
    check_trajectory(script, arm)
    check_contacts(script, arm)
    q, qd, qdd = joint_motion(script.trajectory, script.rate)
    t = np.arange(len(q)) / script.rate
    rotations, origins = link_poses(arm, q)

    loads, touches = [], []
    for contact in script.contacts:
        load, touch = _touch(contact, arm, t, rotations, origins)
        loads.append(load)
        touches.append(touch)
    torque, wrench = inverse_dynamics(arm, q, qd, qdd, loads, script.gravity)

    noise, chance = script.noise, np.random.default_rng(script.noise.seed)
    torque += noise.joint_torque * chance.standard_normal(torque.shape)
    wrench += chance.standard_normal(wrench.shape) * np.repeat([noise.base_force, noise.base_moment], 3)
    qd = measured_velocity(qd, noise.joint_velocity, chance)
    for array in (t, q, qd, qdd, torque, wrench):
        array.setflags(write=False)
    return Motion(arm, script.rate, t, q, qd, qdd, torque, wrench, tuple(touches))


def joint_motion(trajectory: Trajectory, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint positions, velocities and accelerations of a trajectory.

    Args:
        trajectory: Postures and times.
        rate: Samples per second [Hz].

    Returns:
        q [rad], qd [rad/s], qdd [rad/s^2], each of shape (N, n) with N = duration * rate, at least one.
    """
    t = np.arange(max(1, round(trajectory.duration * rate))) / rate
    here = np.array(trajectory.start, dtype=np.float64)
    q = np.tile(here, (len(t), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    begin = trajectory.dwell
    for move in trajectory.moves:
        there, span = np.array(move.to, dtype=np.float64), move.duration
        at = t >= begin
        u = np.clip((t[at] - begin) / span, 0.0, 1.0)[:, None]
        q[at] = here + (there - here) * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))
        qd[at] = (there - here) * (30.0 * u**2 * (1.0 - u) ** 2) / span
        qdd[at] = (there - here) * (60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)) / span**2
        here, begin = there, begin + span + move.dwell
    return q, qd, qdd


def _touch(
    contact: Contact, robot: Robot, t: np.ndarray, rotations: np.ndarray, origins: np.ndarray
) -> tuple[LinkLoad, Touch]:
    """One scripted contact as a load on its link, in link axes, and as ground truth, in base axes."""
    index = robot.link_names.index(contact.link)
    rotation, origin = rotations[index], origins[index]
    point = np.array(contact.point, dtype=np.float64)
    normal = np.array(contact.normal or (0.0, 0.0, 0.0), dtype=np.float64)
    normal /= np.linalg.norm(normal) or 1.0

    level = _level(t - contact.start, contact.duration, contact.ramp)
    if contact.push is not None:
        full = np.broadcast_to(-contact.push * normal, (len(t), 3))
    elif contact.force_link is not None:
        full = np.broadcast_to(np.array(contact.force_link), (len(t), 3))
    else:  # fixed in space while the link rotates
        full = np.einsum("nji,j->ni", rotation, np.array(contact.force_base, dtype=np.float64))
    force = level[:, None] * full
    torsion = level * contact.torsion
    load = LinkLoad(index, force, np.cross(point, force) + torsion[:, None] * normal)

    during = np.flatnonzero((t >= contact.start) & (t <= contact.start + contact.duration))
    touch = Touch(
        link=contact.link,
        link_index=index,
        point_link=point,
        start=contact.start,
        stop=contact.start + contact.duration,
        first=int(during[0]) if len(during) else 0,
        point_base=(origin + rotation @ point)[during],
        force_base=np.einsum("nij,nj->ni", rotation, force)[during],
        torsion=torsion[during],
    )
    return load, touch


def _level(since: np.ndarray, duration: float, ramp: float) -> np.ndarray:
    """Fraction of the full force at times since onset: 0 outside, raised cosine ramps, 1 in between."""
    edge = np.minimum(since, duration - since)  # distance to the nearer end
    if ramp == 0.0:
        return np.where(edge >= 0.0, 1.0, 0.0)
    level: np.ndarray = 0.5 - 0.5 * np.cos(np.pi * np.clip(edge / ramp, 0.0, 1.0))
    return level


def _load(name: str) -> Robot:
    try:
        return robots.load(name)
    except robots.RobotError as error:
        raise ScriptError(f"robot: {error}") from None


def check_trajectory(script: Script, robot: Robot) -> None:
    """Check that the arm can follow the trajectory.

    Raises:
        ScriptError: The number of joints differs, or a posture or speed exceeds a joint's limits.
    """
    n = len(robot.joints)
    here = script.trajectory.start
    if len(here) != n:
        raise ScriptError(f"trajectory.start: expected {n} joint positions for {robot.name}, got {len(here)}")
    stops: list[tuple[str, tuple[float, ...], float | None]] = [("start", here, None)]
    stops += [(f"moves[{i}].to", move.to, move.duration) for i, move in enumerate(script.trajectory.moves)]
    for field, there, span in stops:
        for joint, a, b in zip(robot.joints, here, there, strict=True):
            low, high = joint.position_limits
            if not low <= b <= high:
                raise ScriptError(
                    f"trajectory.{field}: expected {joint.name} within {low:g} to {high:g} rad, got {b:g} rad"
                )
            peak = 1.875 * abs(b - a) / span if span is not None else 0.0  # of a quintic
            if peak > joint.velocity_limit:
                raise ScriptError(
                    f"trajectory.{field}: expected {joint.name} at no more than {joint.velocity_limit:g} "
                    f"rad/s, got {peak:.3g} rad/s; give the move a longer duration"
                )
        here = there
