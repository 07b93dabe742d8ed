"""A simulated year of a fleet as a dataset: short recordings from the mock's physics with known contacts,
drifting biases and drifting friction.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from contactsense import Scene
from contactsense.benchmarks.multi_contact.trials import Trials
from contactsense.service.mock.arm.script import Contact, Move, Noise, Script, Trajectory
from contactsense.service.mock.arm.simulated_arm import Motion, joint_motion, simulate
from contactsense.service.recordings.export import write_columns

COULOMB, VISCOUS = (6.0, 6.0, 4.0, 2.0, 2.0, 2.0), (6.0, 6.0, 4.0, 2.0, 2.0, 2.0)
"""Friction of the joints in the scenes [Nm, Nm s/rad]."""
FRICTION_DRIFT, WORN_DRIFT = 0.15, 0.8
"""Maximum relative change of friction over the year; the same for the one robot that wears."""
DAY_DEVIATION = 0.02
"""Relative deviation of friction from day to day, as the oil is warm or cold."""
FORCE_DRIFT, MOMENT_DRIFT, TORQUE_DRIFT = 0.1, 0.01, 0.3
"""Standard deviations of the biases' change over the year: base force [N], base moment [Nm], joints [Nm]."""
HOME = (0.0, -1.3, 1.6, -1.9, -1.57, 0.0)
"""Posture from which the arms move [rad]."""
FORCES, DURATIONS = (10.0, 60.0), (0.4, 1.5)
"""Forces [N] and durations [s] of contacts."""
CONTACT_INTERVAL, FIRST_CONTACT = 6.0, 5.0
"""Time between the starts of contacts, and before the first [s]."""
BROKEN_EVERY = 101
"""One in this many recordings is broken."""


@dataclass(frozen=True)
class RecordingTask:
    """One recording to generate."""

    folder: str
    """Folder of the dataset."""
    number: int
    """Number of the recording."""
    robot: int
    """Number of the robot."""
    day: int
    """Days since the start of the year."""
    year: float
    """The same as a fraction of the time that the dataset covers."""
    seconds: float
    """Length [s]."""

    @property
    def robot_name(self) -> str:
        """Name of the robot in the dataset."""
        return f"arm{self.robot:02d}"

    @property
    def name(self) -> str:
        """Path in the dataset."""
        day = date(2025, 1, 1) + timedelta(days=self.day)
        return f"robot={self.robot_name}/date={day.isoformat()}/{self.number:06d}.parquet"

    @property
    def broken(self) -> bool:
        """Whether the file is deliberately corrupted."""
        return self.number % BROKEN_EVERY == BROKEN_EVERY // 2


def plan(folder: Path, recordings: int, robots: int, seconds: float) -> list[RecordingTask]:
    """The recordings of a year, evenly distributed over robots and days."""
    tasks = []
    for number in range(recordings):
        turn, turns = number // robots, max(-(-recordings // robots) - 1, 1)
        day = round(364 * turn / turns)
        tasks.append(RecordingTask(str(folder), number, number % robots, day, turn / turns, seconds))
    return tasks


def write_scenes(folder: Path, robots: int) -> None:
    """Write the scene of each robot to its folder; every third is a larger arm."""
    for robot in range(robots):
        here = folder / f"robot=arm{robot:02d}"
        here.mkdir(parents=True, exist_ok=True)
        (here / "scene.yaml").write_text(yaml.safe_dump(scene_settings(robot), sort_keys=False))


def scene_settings(robot: int) -> dict[str, Any]:
    """Content of a robot's scene file."""
    friction = {"coulomb": list(COULOMB), "viscous": list(VISCOUS), "error": 0.15}
    return {
        "robot": "ur10e" if robot % 3 == 2 else "ur5e",
        "joint_torque": {"model_error": 0.3, "friction": friction},
    }


def friction_drift(robot: int) -> np.ndarray:
    """Relative change of each joint's friction over the year, shape (6,); robot 1 wears."""
    chance = np.random.default_rng([71, robot])
    drift = chance.uniform(-FRICTION_DRIFT, FRICTION_DRIFT, 6)
    if robot == 1:
        drift[1] = WORN_DRIFT
    return np.asarray(drift)


def bias_drift(robot: int) -> tuple[np.ndarray, np.ndarray]:
    """Change of the biases over the year: base wrench (6,) [N, Nm], joint torques (6,) [Nm]."""
    chance = np.random.default_rng([72, robot])
    base = chance.standard_normal(6) * np.repeat([FORCE_DRIFT, MOMENT_DRIFT], 3)
    return base, TORQUE_DRIFT * chance.standard_normal(6)


def make_recording(task: RecordingTask) -> list[dict[str, Any]]:
    """Generate one recording; returns its contacts, or none if the file is broken."""
    chance = np.random.default_rng([73, task.number])
    trials = _trials(task.robot % 3 == 2)
    trajectory = _trajectory(task.seconds, chance)
    contacts = list(_contacts(trajectory, trials, chance))
    noise = Noise(base_force=0.25, base_moment=0.05, joint_torque=1.0, seed=task.number)
    script = Script(
        robot=str(scene_settings(task.robot)["robot"]), noise=noise, trajectory=trajectory, contacts=contacts
    )
    path = Path(task.folder) / task.name
    path.parent.mkdir(parents=True, exist_ok=True)
    start = round(float(chance.uniform(0.0, 1e5)), 3)
    _write(simulate(script), task, start, path)
    if task.broken:
        _break(path, task.number // BROKEN_EVERY)
        return []
    return [
        {
            "recording": task.name,
            "link": contact.link,
            "begin": start + contact.start,
            "end": start + contact.start + contact.duration,
            "force": float(np.linalg.norm(contact.force_link or 0.0)),
            "point": list(contact.point),
        }
        for contact in contacts
    ]


@lru_cache(maxsize=2)
def _trials(large: bool) -> Trials:
    return Trials(Scene(robot="ur10e" if large else "ur5e"), 1 if large else 0)


def _trajectory(seconds: float, chance: np.random.Generator) -> Trajectory:
    """Random moves around `HOME`."""
    moves, time = [], 2.0
    while time < seconds - 1e-9:
        duration = min(float(chance.uniform(1.5, 3.0)), seconds - time)
        if seconds - time - duration < 1.5:
            duration = seconds - time
        to = tuple(float(x) for x in np.array(HOME) + chance.uniform(-0.7, 0.7, 6))
        moves.append(Move(to=to, duration=duration))
        time += duration
    return Trajectory(start=HOME, dwell=2.0, moves=tuple(moves))


def _contacts(trajectory: Trajectory, trials: Trials, chance: np.random.Generator) -> Iterator[Contact]:
    """Random contacts: in every other recording, one in half of the intervals."""
    if chance.random() < 0.5:
        return
    q, _, _ = joint_motion(trajectory, 100.0)
    start = FIRST_CONTACT
    while start + DURATIONS[1] < trajectory.duration - 1.0:
        if chance.random() < 0.5:
            duration = float(chance.uniform(*DURATIONS))
            posture = q[min(round(100.0 * (start + 0.5 * duration)), len(q) - 1)]
            push, rotation, origin = trials.push_at(posture, float(chance.uniform(*FORCES)))
            yield Contact(
                link=trials.link_names[push.link],
                point=_vector(rotation.T @ (push.point - origin)),
                force_link=_vector(rotation.T @ push.force),
                start=start,
                duration=duration,
            )
        start += CONTACT_INTERVAL


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _write(motion: Motion, task: RecordingTask, start: float, path: Path) -> None:
    """Write the readings with the day's friction and biases; `start`: time of the first sample [s]."""
    base_bias, joint_bias = bias_drift(task.robot)
    day = np.random.default_rng([74, task.robot, task.day]).standard_normal(6)
    factor = 1.0 + task.year * friction_drift(task.robot) + DAY_DEVIATION * day
    friction = factor * (np.array(COULOMB) * np.tanh(motion.qd / 0.01) + np.array(VISCOUS) * motion.qd)
    columns = {"timestamp": start + motion.t}
    for name, values in (
        ("actual_q", motion.q), ("actual_qd", motion.qd),
        ("joint_torque", motion.joint_torque + friction + task.year * joint_bias),
        ("base_wrench", motion.base_wrench + task.year * base_bias),
    ):  # fmt: skip
        columns |= {f"{name}_{i}": values[:, i] for i in range(values.shape[1])}
    if task.broken and task.number // BROKEN_EVERY % 3 == 2:
        del columns["actual_qd_3"]
    write_columns(path, columns)


def _break(path: Path, kind: int) -> None:
    """Truncate the file, or empty it; the third kind already lacks a column."""
    if kind % 3 < 2:
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2] if kind % 3 == 0 else b"")
