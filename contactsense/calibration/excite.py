"""Which motion to make for a calibration: short, safe, and telling.

Sums of harmonics, from rest to rest, are drawn at random and the best is improved by small changes; each is
shrunk until it keeps the joints' limits and its distance from the arm itself and from the plane that the arm
stands on. The best is the one that shrinks the volume of what the parameters may be by most (D-optimality; J.
Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 1997).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contactsense.calibration.calibrate import CalibrationError, default_groups
from contactsense.calibration.clearance import Clearance
from contactsense.calibration.expect import Expected, expect, quiet
from contactsense.calibration.harmonics import Harmonics
from contactsense.calibration.parameters import ON_DEMAND, Group
from contactsense.scene import Scene
from contactsense.sensing import JointTorqueSensor

HARMONICS = 7
_HOME = (0.0, -1.3, 1.5, -1.0, 0.8, 0.0)
"""An arm with six joints starts and ends with its elbow up in front of it."""
_CHECK = 0.04
"""Clearance is looked at so often while searching [s]."""
_FINE = 0.01
"""And of the motion that is proposed [s]."""
_SHRINK = 0.85
_MOST_SHRINKS = 12
_MARGIN = 0.05
"""Distance from the joints' position limits [rad]."""
_CHANGE = 0.35
"""Size of a change, of a random motion's."""
_RATE = 100.0
"""Samples a second that candidates are judged by [Hz]."""
_SETTLE = 2.0
"""Shortest motion that a calibration takes, twice [s]."""


@dataclass(frozen=True)
class Wishes:
    """What the motion must keep to."""

    seconds: float = 20.0
    """Length [s]."""
    speed: float = 0.4
    """Highest speed of each joint, of its limit."""
    torque: float = 0.8
    """Highest torque of each joint, of its limit."""
    floor: float = 0.05
    """Height above the plane z = 0 of the base frame that all moving links keep [m]."""
    room: float = 0.05
    """Distance that links which are no neighbours keep from each other [m]."""
    home: tuple[float, ...] | None = None
    """Posture about which the arm swings [rad]; without it, elbow up for six joints."""


@dataclass(frozen=True)
class Proposal:
    """A motion, and what is known of it. n joints."""

    motion: Harmonics
    expected: Expected
    """What a calibration will know from it."""
    lowest: float
    """Height of the lowest place of the moving links [m]."""
    nearest: float
    """Smallest distance between links that are no neighbours [m]."""
    speed: np.ndarray
    """Highest speed of each joint [rad/s], shape (n,)."""
    torque: np.ndarray
    """Highest torque of each joint [Nm], shape (n,)."""


def groups_of(scene: Scene) -> tuple[Group, ...]:
    """What `contactsense calibrate` estimates with the scene's sensors, but what it takes on demand only."""
    still = np.zeros((3, len(scene.robot.joints)))
    pretended = quiet(scene, Harmonics(still[0], 0.0 * still.T, 0.0 * still.T, 1.0), 3.0)
    return tuple(group for group in default_groups(scene, [pretended]) if group not in ON_DEMAND)


def propose(
    scene: Scene,
    wishes: Wishes | None = None,
    tries: int = 60,
    seed: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> Proposal:
    """A contact-free motion from which the scene can be calibrated.

    Args:
        scene: Arm, tool and sensors; its noise says what will be known.
        wishes: What the motion must keep to.
        tries: How many motions are looked at.
        seed: Of the random numbers.
        progress: Called after each of them.

    Raises:
        CalibrationError: no motion keeps to the wishes; the message says which one is in the way.
    """
    wishes = wishes or Wishes()
    search = _Search(scene, wishes)
    chance = np.random.default_rng(seed)
    groups = groups_of(scene)
    found: list[tuple[float, Harmonics]] = []
    for number in range(tries):
        motion = search.draw(chance)
        if found and number >= tries // 2:
            motion = _changed(max(found, key=lambda pair: pair[0])[1], motion)
        fitting = search.fit(motion)
        if fitting is not None:
            found.append((expect(scene, groups, fitting, _RATE).gain, fitting))
        progress()
    for _, motion in sorted(found, key=lambda pair: -pair[0]):
        if search.keeps(motion, _FINE):
            return search.proposal(motion, expect(scene, groups, motion, _RATE))
    raise CalibrationError(
        f"no motion of {wishes.seconds:g} s found that keeps {wishes.floor:g} m above the base plane and "
        f"{wishes.room:g} m between links: another --home, or less of --floor or --room"
    )


def _changed(motion: Harmonics, other: Harmonics) -> Harmonics:
    """A motion with a part of another; as both rest at their ends, so does the sum."""
    return replace(
        motion, sine=motion.sine + _CHANGE * other.sine, cosine=motion.cosine + _CHANGE * other.cosine
    )


class _Search:
    """Motions of one arm that keep to the wishes."""

    def __init__(self, scene: Scene, wishes: Wishes) -> None:
        joints = scene.robot.joints
        n = len(joints)
        if wishes.home is None and n != len(_HOME):
            raise CalibrationError(f"home: expected a posture for {scene.robot.name}, got none")
        home = np.array(_HOME if wishes.home is None else wishes.home, dtype=float)
        if home.shape != (n,):
            raise CalibrationError(f"home: expected {n} angles, got {home.size}")
        if wishes.seconds < 2.0 * _SETTLE:
            raise CalibrationError(f"seconds: expected at least {2.0 * _SETTLE:g}, got {wishes.seconds:g}")
        self._scene, self._wishes, self._home = scene, wishes, home
        self._low, self._high = np.array([joint.position_limits for joint in joints]).T
        self._fastest = wishes.speed * np.array([joint.velocity_limit for joint in joints])
        self._strongest = wishes.torque * np.array([joint.torque_limit for joint in joints])
        self._clearance = Clearance(scene, home, wishes.room)
        if self._clearance.lowest(home[None])[0] < wishes.floor:
            raise CalibrationError(
                f"home: this posture is lower than {wishes.floor:g} m above the base plane"
            )

    def draw(self, chance: np.random.Generator) -> Harmonics:
        """A random motion with the highest speed in every joint, whatever it meets."""
        motion = Harmonics.draw(chance, self._home, self._fastest, HARMONICS, self._wishes.seconds)
        return self._slowed(motion)

    def _slowed(self, motion: Harmonics) -> Harmonics:
        _, qd, _ = motion.at(np.arange(0.0, motion.period, _FINE))
        share = (self._fastest / np.abs(qd).max(axis=0))[:, None]
        return replace(motion, sine=share * motion.sine, cosine=share * motion.cosine)

    def fit(self, motion: Harmonics) -> Harmonics | None:
        """The motion made smaller until it keeps to all wishes; None where that leaves too little."""
        motion = self._slowed(motion)
        for _ in range(_MOST_SHRINKS):
            if self.keeps(motion, _CHECK):
                return motion
            motion = replace(motion, sine=_SHRINK * motion.sine, cosine=_SHRINK * motion.cosine)
        return None

    def keeps(self, motion: Harmonics, step: float) -> bool:
        """Whether a motion keeps to all wishes, looked at every `step` seconds."""
        q, _, _ = motion.at(np.arange(0.0, motion.period, step))
        if (q < self._low + _MARGIN).any() or (q > self._high - _MARGIN).any():
            return False
        if (self._torques(motion, 1.0 / step) > self._strongest).any():
            return False
        if self._clearance.lowest(q).min() < self._wishes.floor:
            return False
        return bool(self._clearance.nearest(q).min() >= self._wishes.room)

    def _torques(self, motion: Harmonics, rate: float) -> np.ndarray:
        """Highest torque of each joint, as the model has it, shape (n,) [Nm]."""
        scene = self._scene
        if scene.joint_torque is None or scene.joint_torque.contains != "motor":
            scene = scene.model_copy(update={"joint_torque": JointTorqueSensor()})
        torque = quiet(scene, motion, rate).torque
        assert torque is not None
        return np.asarray(np.abs(torque).max(axis=0))

    def proposal(self, motion: Harmonics, expected: Expected) -> Proposal:
        """A motion with all that is said of it."""
        q, qd, _ = motion.at(np.arange(0.0, motion.period, _FINE))
        return Proposal(
            motion,
            expected,
            float(self._clearance.lowest(q).min()),
            float(self._clearance.nearest(q).min()),
            np.abs(qd).max(axis=0),
            self._torques(motion, 1.0 / _FINE),
        )
