"""A fingertip on the forearm of a UR5e: held at one place, or moved along the arm; the arm may move.

The finger touches the estimator's own surface, so that all errors come from noise and motion.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactsense import JointTorqueSensor, Sample, Scene, WrenchSensor, robots
from contactsense.benchmarks.motion.model_error import MASS_ERROR, heavier
from contactsense.benchmarks.static_truth.cases import COLUMNS, Noise
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.surface.union import distances
from contactsense.scene_model.constants import build_constants

NOISE = COLUMNS[2]
LINK = 3
RATE = 500.0
FREE = 1.0
"""Time without contact at the start [s]."""
PUSH = 20.0
"""Force of the finger [N], inclined by a tenth."""
RAMP = 0.03
"""Rise time of the force [s]."""
_HOME = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
_RATES = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
"""Angular frequency of each joint's swing [rad/s]."""


@dataclass(frozen=True)
class Case:
    """A simulated case."""

    name: str
    speed: float = 0.0
    """Highest speed of each joint [rad/s]."""
    wrong: bool = False
    """Whether the estimator's masses are 2 % too large, within their stated uncertainty."""
    slide: float = 0.0
    """Speed of the finger along the forearm between 0.5 s and 1.5 s after its touch [m/s]."""


CASES = (
    Case("at rest"),
    Case("moving", speed=0.5),
    Case("moving, masses 2 % off", speed=0.5, wrong=True),
)
SLIDE = Case("slide", speed=0.2, slide=0.05)
TIMES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Holding times [s]."""


def scene_of(case: Case) -> Scene:
    """Scene of the estimator."""
    robot = robots.load("ur5e")
    return Scene(
        robot=heavier(robot, MASS_ERROR) if case.wrong else robot,
        inertia_error=MASS_ERROR if case.wrong else 0.0,
        base_wrench=WrenchSensor(force_noise=NOISE.force, moment_noise=NOISE.moment),
        joint_torque=JointTorqueSensor(noise=NOISE.torque),
    )


class Finger:
    """Position of the finger in the frame of the forearm."""

    def __init__(self) -> None:
        """Start on the side of the forearm."""
        self._surfaces = build_constants(Scene(robot=robots.load("ur5e"))).surfaces

    def at(self, way: float) -> tuple[np.ndarray, np.ndarray]:
        """Point [m] and outward normal after the distance `way` along the forearm [m]."""
        point = np.array([[-0.16 - way, 0.06, 0.02]])
        normal = np.zeros((1, 3))
        for _ in range(4):
            distance, _, normal = distances(self._surfaces, point, LINK)
            point = point - distance[:, None] * normal
        return point[0], normal[0]


def stream(
    case: Case, finger: Finger, seconds: float, seed: int, noise: Noise = NOISE
) -> Iterator[tuple[Sample, np.ndarray, float]]:
    """Samples of the stream, the true point of contact in the base frame [m], and the time since the touch
    (negative before it) [s]."""
    robot = robots.load("ur5e")
    model, motion, gravity = build_model(robot), empty_motion(6), Scene(robot=robot).gravity_base
    torque, wrench, rng = np.empty(6), np.empty(6), np.random.default_rng(seed)
    held, normal = finger.at(0.0)
    tangential = 0.1 * np.array([-1.0, 0.0, 0.0])  # as the slide, whose friction drags the arm along
    for t in np.arange(0.0, FREE + seconds, 1.0 / RATE):
        q = _HOME + case.speed / _RATES * np.sin(_RATES * t)
        qd, qdd = case.speed * np.cos(_RATES * t), -case.speed * _RATES * np.sin(_RATES * t)
        inverse_dynamics(model, q, qd, qdd, gravity, motion, torque, wrench)
        since = float(t) - FREE
        if case.slide > 0.0:
            held, normal = finger.at(case.slide * float(np.clip(since - 0.5, 0.0, 1.0)))
        R, o = motion.rotation[LINK], motion.origin[LINK]
        point = R @ held + o
        force = R @ (tangential - normal) * PUSH * float(np.clip(since / RAMP, 0.0, 1.0))
        w = np.concatenate((force, np.cross(point, force)))
        yield (
            Sample(
                float(t),
                q,
                qd,
                torque - np.where(np.arange(6) < LINK, motion.screw @ w, 0.0)
                + noise.torque * rng.standard_normal(6),
                wrench + w + np.repeat(noise[:2], 3) * rng.standard_normal(6),
            ),
            point,
            since,
        )  # fmt: skip
