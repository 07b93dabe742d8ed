"""Cases for the comparison of methods, and the score of their answers."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers, Method
from contactsense.benchmarks.static_truth.cases import COLUMNS, SENSORS, Detail, Noise, measured, scene_of
from contactsense.benchmarks.static_truth.points import StaticPoints, read, select
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta

TRUTH = Path(__file__).resolve().parents[3] / "shared" / "data" / "truth"
"""Folder of the static ground truth, next to the project."""
MESHES = TRUTH.parent / "ur_visual"
"""Folder of the visual meshes, ROBOT/LINK.ply."""
ROBOTS = ("ur5e", "ur10e")


class Case(NamedTuple):
    """N contacts with one level of noise and one set of sensors; external parts as in `Method`."""

    points: StaticPoints
    noise: Noise
    sensors: str
    scene: Scene
    base_wrench: np.ndarray | None
    joint_torque: np.ndarray | None

    @property
    def q(self) -> np.ndarray:
        """Joint positions, shape (N, n) [rad]."""
        return self.points.q


class Score(NamedTuple):
    """Score of the answers to one case."""

    link_right: float
    """Fraction of the answers with the touched link; a missing answer counts as wrong."""
    median: float
    """Median distance of the estimated point from the true one, infinite for a missing answer [m]."""
    p95: float
    """95 % quantile of the same [m]."""
    seconds: float
    """Time per answer, `nan` if not measured [s]."""


def cases(
    points: StaticPoints,
    columns: Sequence[Noise] = COLUMNS,
    sensors: Sequence[str] = tuple(SENSORS),
    detail: Detail = "fine",
    meshes: Path | None = MESHES,
) -> Iterator[Case]:
    """The contacts with every noise level and set of sensors; the arm's weight is subtracted with our
    model."""
    weight_wrench, weight_torque = weight(points)
    for kind in sensors:
        for noise in columns:
            wrench, torque = measured(points, noise, kind)
            yield Case(
                points=points,
                noise=noise,
                sensors=kind,
                scene=scene_of(points, noise, kind, detail, meshes),
                base_wrench=None if wrench is None else wrench - weight_wrench,
                joint_torque=None if torque is None else torque - weight_torque,
            )


def static_cases(
    robot: str,
    columns: Sequence[Noise] = COLUMNS,
    sensors: Sequence[str] = tuple(SENSORS),
    detail: Detail = "fine",
    rows: slice = slice(None),
    folder: Path = TRUTH,
) -> Iterator[Case]:
    """Cases of the given ground truth of one arm; `rows` selects contacts."""
    yield from cases(select(read(folder, robot), rows), columns, sensors, detail)


def weight(points: StaticPoints) -> tuple[np.ndarray, np.ndarray]:
    """Base wrench and joint torques due to the arm's own weight, shapes (N, 6) and (N, n) [N, Nm]."""
    scene = Scene(robot=points.robot, gravity=points.gravity)
    model = build_model(scene.robot)
    motion = empty_motion(model.joints)
    rest = np.zeros(model.joints)
    wrench, torque = np.empty((len(points.q), 6)), np.empty_like(points.q)
    for i, q in enumerate(points.q):
        kinematics_and_momenta(model, q, rest, scene.gravity_base, motion)
        wrench[i] = motion.gravity[0]
        torque[i] = -(motion.screw * motion.gravity[1:]).sum(axis=1)
    return wrench, torque


def answer(method: Method, case: Case) -> tuple[Answers, float]:
    """Answers to one case and the time per answer [s], after one sample as warm-up."""
    first = slice(0, 1)
    base, torque = case.base_wrench, case.joint_torque
    method(case.q[first], None if base is None else base[first], None if torque is None else torque[first])
    start = time.perf_counter()
    answers = method(case.q, base, torque)
    return answers, (time.perf_counter() - start) / len(case.q)


def errors(answers: Answers, points: StaticPoints) -> np.ndarray:
    """Distance of each answer from the truth, infinite without an answer, shape (N,) [m]."""
    distance = np.linalg.norm(answers.point_base - points.point_base, axis=1)
    return np.asarray(np.where(answers.link >= 0, distance, np.inf))


def score(answers: Answers, points: StaticPoints, seconds: float = np.nan) -> Score:
    """Quantiles over all samples, including failures."""
    median, p95 = np.quantile(errors(answers, points), [0.5, 0.95], method="higher")
    return Score(
        link_right=float((answers.link == points.link).mean()),
        median=float(median),
        p95=float(p95),
        seconds=seconds,
    )
