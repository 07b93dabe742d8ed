"""Cases of the static ground truth for benchmarks: noise levels, sets of sensors, scenes."""

from pathlib import Path
from typing import Literal, NamedTuple

import click
import numpy as np

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.arms import arm
from contactsense.benchmarks.static_truth.points import StaticPoints
from contactsense.benchmarks.truth_arms import name_of
from contactsense.scene import LinkPrior

SENSORS = {
    "all": (True, True),
    "base": (True, False),
    "torques": (False, True),
}
"""Set of sensors -> whether base wrench and joint torques are present."""

Detail = Literal["coarse", "fine", "skin"]


class Noise(NamedTuple):
    """Standard deviations of one sample."""

    force: float
    """Base force [N]."""
    moment: float
    """Base moment [Nm]."""
    torque: float
    """Joint torque [Nm]."""

    def __str__(self) -> str:
        return " / ".join(f"{level:g}" for level in self)


COLUMNS = (Noise(0.0, 0.0, 0.0), Noise(0.05, 0.01, 0.3), Noise(0.25, 0.05, 1.0), Noise(1.0, 0.2, 3.0))
"""The noise levels of the design's tables."""
ASSUMED = Noise(0.02, 0.004, 0.02)
"""Noise that the estimator assumes for sensors without noise: it needs a finite value."""
EXACT = Noise(0.002, 0.0004, 0.002)
"""The same for these contacts, which are at rest and exact except for rounding. With 20 N it moves a point by
0.02 mm, a tenth of the surface error, so that rows without noise show the surface error."""


def stated_noise(noise: Noise) -> Noise:
    """What the scene of a row states: at least `EXACT`."""
    return Noise(*(max(level, floor) for level, floor in zip(noise, EXACT, strict=True)))


def scene_of(
    points: StaticPoints,
    noise: Noise,
    sensors: str = "all",
    detail: Detail = "fine",
    meshes: Path | None = None,
    link_prior: LinkPrior = "area",
) -> Scene:
    """The scene of the contacts, with their noise.

    Args:
        points: Contacts on one arm.
        noise: Noise of the sensors; at least `EXACT` is assumed.
        sensors: Set of sensors, a key of `SENSORS`.
        detail: Level of detail of the surface.
        meshes: For `detail` skin: folder with ROBOT/LINK.ply.
        link_prior: See `Scene`.

    Raises:
        click.ClickException: the arm cannot be read, or has another number of joints.
    """
    stated, robot = stated_noise(noise), arm(points.robot)
    joints, given = len(robot.joints), points.q.shape[1]
    if joints != given:
        raise click.ClickException(
            f"{points.robot}: expected ground truth of {joints} joints, as the arm has, got {given}; "
            "name the same --tip for both"
        )
    has_base, has_torque = SENSORS[sensors]
    return Scene(
        robot=robot,
        gravity=points.gravity,
        detail=detail,
        meshes=meshes / name_of(points.robot) if detail == "skin" and meshes is not None else None,
        base_wrench=WrenchSensor(force_noise=stated.force, moment_noise=stated.moment) if has_base else None,
        joint_torque=JointTorqueSensor(noise=stated.torque) if has_torque else None,
        link_prior=link_prior,
    )


def measured(
    points: StaticPoints, noise: Noise, sensors: str = "all"
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Base wrench and joint torques with that noise, shapes (N, 6) and (N, n) [N, Nm]; None where absent."""
    has_base, has_torque = SENSORS[sensors]
    wrench = points.base_wrench + points.noise_wrench * np.repeat(noise[:2], 3) if has_base else None
    torque = points.torque + points.noise_torque * noise.torque if has_torque else None
    return wrench, torque
