"""Excitation trajectory for a calibration: short, collision-free and informative.

Fourier trajectories from rest to rest are drawn at random, and the best one is improved by small changes.
Each is scaled down until it respects the joints' limits and its distances from the arm itself and from the
base plane. The best trajectory maximizes the determinant of the information matrix (D-optimality; J. Swevers
et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 1997).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contactsense.calibration.contact_free_fit import CalibrationError, default_groups
from contactsense.calibration.motion.clearance import Clearance
from contactsense.calibration.motion.expected_uncertainty import (
    ExpectedUncertainty,
    expected_uncertainty,
    simulated_free_motion,
)
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.calibration.parameters import OPTIONAL_FRICTION, Group
from contactsense.plausibility.largest_reading import joints_of_unknown_speed
from contactsense.scene import Scene
from contactsense.sensors.settings import JointTorqueSensor

HARMONICS = 7
"""Number of harmonics of the motion."""
_HOME = (0.0, -1.3, 1.5, -1.0, 0.8, 0.0)
"""Default posture of a six-joint arm: elbow up in front of it."""
_SEARCH_STEP = 0.04
"""Time step of collision checks during the search [s]."""
_FINAL_STEP = 0.01
"""The same for the proposed motion [s]."""
_SHRINK, _MAX_SHRINKS = 0.85, 12
"""A motion beyond a limit, or in collision, is made smaller by this factor, at most so often."""
_LIMIT_MARGIN = 0.05
"""Distance from the joints' position limits [rad]."""
_MUTATION = 0.35
"""Amplitude of a change relative to a random trajectory."""
_RATE = 100.0
"""Sample rate at which candidates are evaluated [Hz]."""
_MIN_RECORDING = 2.0
"""Half the shortest motion [s]."""


@dataclass(frozen=True)
class ExcitationSettings:
    """Constraints of the motion."""

    seconds: float = 20.0
    """Length [s]."""
    speed: float = 0.4
    """Largest speed of each joint, as a fraction of its limit."""
    torque: float = 0.8
    """Largest torque of each joint, as a fraction of its limit if that is known."""
    floor: float = 0.05
    """Smallest height of all moving links above the plane z = 0 of the base frame [m]."""
    clearance: float = 0.05
    """Smallest distance between links that are not adjacent [m]."""
    home: tuple[float, ...] | None = None
    """Posture about which the arm moves [rad]; None: elbow up, for six joints."""


@dataclass(frozen=True)
class Proposal:
    """A motion and its expected calibration. n joints."""

    motion: FourierTrajectory
    expected: ExpectedUncertainty
    """Expected uncertainty of a calibration from it."""
    lowest: float
    """Height of the lowest point of the moving links [m]."""
    nearest: float
    """Smallest distance between links that are not adjacent [m]."""
    speed: np.ndarray
    """Highest speed of each joint [rad/s], shape (n,)."""
    torque: np.ndarray
    """Highest torque of each joint [Nm], shape (n,)."""


def groups_of(scene: Scene) -> tuple[Group, ...]:
    """Groups that `contactsense calibrate` estimates with the scene's sensors, without the optional ones."""
    zeros = np.zeros((3, len(scene.robot.joints)))
    recording = simulated_free_motion(
        scene, FourierTrajectory(zeros[0], 0.0 * zeros.T, 0.0 * zeros.T, 1.0), 3.0
    )
    return tuple(group for group in default_groups(scene, [recording]) if group not in OPTIONAL_FRICTION)


def propose_excitation(
    scene: Scene,
    settings: ExcitationSettings | None = None,
    trials: int = 60,
    seed: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> Proposal:
    """A contact-free motion from which the scene can be calibrated.

    Args:
        scene: Arm, tool and sensors; their noise determines the expected uncertainty.
        settings: Constraints of the motion.
        trials: Number of trajectories evaluated.
        seed: Seed of the random numbers.
        progress: Called after each of them.

    Raises:
        CalibrationError: no trajectory satisfies the constraints; the message names the limiting one.
    """
    settings = settings or ExcitationSettings()
    search = _Search(scene, settings)
    rng = np.random.default_rng(seed)
    groups = groups_of(scene)
    candidates: list[tuple[float, FourierTrajectory]] = []
    for number in range(trials):
        motion = search.draw(rng)
        if candidates and number >= trials // 2:
            motion = _mutate(max(candidates, key=lambda pair: pair[0])[1], motion)
        feasible = search.shrink_to_feasible(motion)
        if feasible is not None:
            candidates.append(
                (expected_uncertainty(scene, groups, feasible, _RATE).information_gain, feasible)
            )
        progress()
    for _, motion in sorted(candidates, key=lambda pair: -pair[0]):
        if search.is_feasible(motion, _FINAL_STEP):
            return search.proposal(motion, expected_uncertainty(scene, groups, motion, _RATE))
    raise CalibrationError(
        f"no motion of {settings.seconds:g} s found that keeps {settings.floor:g} m above the base plane and "
        f"{settings.clearance:g} m between links: try another --home, or a smaller --floor or --clearance"
    )


def _mutate(motion: FourierTrajectory, other: FourierTrajectory) -> FourierTrajectory:
    """A trajectory plus a fraction of another; as both are at rest at their ends, so is the sum."""
    return replace(
        motion, sine=motion.sine + _MUTATION * other.sine, cosine=motion.cosine + _MUTATION * other.cosine
    )


class _Search:
    """Feasible trajectories of one arm."""

    def __init__(self, scene: Scene, settings: ExcitationSettings) -> None:
        joints = scene.robot.joints
        n = len(joints)
        if settings.home is None and n != len(_HOME):
            raise CalibrationError(
                f"home: expected {n} angles, the mean posture of {scene.robot.name}, got none"
            )
        home = np.array(_HOME if settings.home is None else settings.home, dtype=float)
        if home.shape != (n,):
            raise CalibrationError(f"home: expected {n} angles, got {home.size}")
        if settings.seconds < 2.0 * _MIN_RECORDING:
            raise CalibrationError(
                f"seconds: expected at least {2.0 * _MIN_RECORDING:g}, got {settings.seconds:g}"
            )
        unknown = joints_of_unknown_speed(scene.robot)
        if unknown:
            raise CalibrationError(
                "robot: expected the largest speed of each joint, which limits the motion, got none of "
                f"{', '.join(unknown)}: add velocity to their limits in the URDF, or velocity_limit in the "
                "file of the arm"
            )
        self._scene, self._settings, self._home = scene, settings, home
        self._low, self._high = np.array([joint.position_limits for joint in joints]).T
        self._max_speed = settings.speed * np.array([joint.velocity_limit for joint in joints])
        self._max_torque = settings.torque * np.array([joint.torque_limit for joint in joints])
        which = "the default posture, that of UR arms," if settings.home is None else "this posture"
        for joint, angle, low, high in zip(joints, home, self._low, self._high, strict=True):
            if not low < angle < high:
                raise CalibrationError(
                    f"home: {which} has {joint.name} at {angle:.3g} rad, expected {low:.3g} to {high:.3g} rad"
                )
        self._clearance = Clearance(scene, home, settings.clearance)
        if self._clearance.lowest(home[None])[0] < settings.floor:
            raise CalibrationError(f"home: {which} is lower than {settings.floor:g} m above the base plane")

    def draw(self, rng: np.random.Generator) -> FourierTrajectory:
        """A random trajectory at the largest speed of every joint, feasible or not."""
        motion = FourierTrajectory.draw(rng, self._home, self._max_speed, HARMONICS, self._settings.seconds)
        return self._scale_to_speed(motion)

    def _scale_to_speed(self, motion: FourierTrajectory) -> FourierTrajectory:
        _, qd, _ = motion.at(np.arange(0.0, motion.period, _FINAL_STEP))
        scale = (self._max_speed / np.abs(qd).max(axis=0))[:, None]
        return replace(motion, sine=scale * motion.sine, cosine=scale * motion.cosine)

    def shrink_to_feasible(self, motion: FourierTrajectory) -> FourierTrajectory | None:
        """The trajectory scaled down until it is feasible; None if it would become too small."""
        motion = self._scale_to_speed(motion)
        for _ in range(_MAX_SHRINKS):
            if self.is_feasible(motion, _SEARCH_STEP):
                return motion
            motion = replace(motion, sine=_SHRINK * motion.sine, cosine=_SHRINK * motion.cosine)
        return None

    def is_feasible(self, motion: FourierTrajectory, step: float) -> bool:
        """Whether a trajectory satisfies all constraints, checked every `step` seconds."""
        q, _, _ = motion.at(np.arange(0.0, motion.period, step))
        if (q < self._low + _LIMIT_MARGIN).any() or (q > self._high - _LIMIT_MARGIN).any():
            return False
        if (self._torques(motion, 1.0 / step) > self._max_torque).any():
            return False
        if self._clearance.lowest(q).min() < self._settings.floor:
            return False
        return bool(self._clearance.nearest(q).min() >= self._settings.clearance)

    def _torques(self, motion: FourierTrajectory, rate: float) -> np.ndarray:
        """Largest torque of each joint according to the model, shape (n,) [Nm]."""
        scene = self._scene
        if scene.joint_torque is None or scene.joint_torque.contains != "motor":
            scene = scene.model_copy(update={"joint_torque": JointTorqueSensor()})
        torque = simulated_free_motion(scene, motion, rate).torque
        assert torque is not None
        return np.asarray(np.abs(torque).max(axis=0))

    def proposal(self, motion: FourierTrajectory, expected: ExpectedUncertainty) -> Proposal:
        """A trajectory with its properties."""
        q, qd, _ = motion.at(np.arange(0.0, motion.period, _FINAL_STEP))
        return Proposal(
            motion,
            expected,
            float(self._clearance.lowest(q).min()),
            float(self._clearance.nearest(q).min()),
            np.abs(qd).max(axis=0),
            self._torques(motion, 1.0 / _FINAL_STEP),
        )
