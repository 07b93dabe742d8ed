"""Simulated streams of an arm that is pushed at several points, at rest or in motion, with ground truth."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from contactsense import Sample, Scene
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion

STEP = 0.002
RAMP = 0.03
"""Rise and fall time of a force [s]."""


@dataclass(frozen=True)
class Push:
    """A contact on a link's surface, link frame, from `start` to `stop` [s]."""

    link: int
    point: tuple[float, float, float]
    force: tuple[float, float, float]
    start: float
    stop: float
    slide: Callable[[float], float] = lambda _: 0.0
    """Displacement along the x axis of the link over time [m]."""
    size: Callable[[float], float] = lambda _: 1.0
    """Factor on the force over time."""


def stream(
    scene: Scene,
    pushes: list[Push],
    seconds: float,
    noise: tuple[float, float, float],
    seed: int,
    speed: float,
) -> Iterator[tuple[Sample, list[np.ndarray]]]:
    """Samples, and the points of the active contacts in the base frame; joints move with up to `speed`
    [rad/s]."""
    model, motion = build_model(scene.robot), empty_motion(6)
    torque, wrench = np.empty(6), np.empty(6)
    rng = np.random.default_rng(seed)
    rate = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
    for t in np.arange(0.0, seconds, STEP):
        q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]) + speed / rate * np.sin(rate * t)
        qd, qdd = speed * np.cos(rate * t), -speed * rate * np.sin(rate * t)
        inverse_dynamics(model, q, qd, qdd, scene.gravity_base, motion, torque, wrench)
        points = []
        for push in pushes:
            if not push.start <= t < push.stop:
                continue
            R, o = motion.rotation[push.link], motion.origin[push.link]
            point = R @ (np.array(push.point) + np.array([push.slide(t), 0.0, 0.0])) + o
            ramp = min((t - push.start) / RAMP, 1.0, (push.stop - t) / RAMP)
            force = R @ np.array(push.force) * ramp * push.size(t)
            w = np.concatenate((force, np.cross(point, force)))
            torque[: push.link] -= motion.screw[: push.link] @ w
            wrench += w
            points.append(point)
        yield (
            Sample(
                float(t), q, qd,
                torque + noise[2] * rng.standard_normal(6),
                wrench + rng.standard_normal(6) * np.repeat(noise[:2], 3),
            ),
            points,
        )  # fmt: skip
