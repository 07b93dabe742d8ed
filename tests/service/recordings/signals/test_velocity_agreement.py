"""Velocities that are not those of the positions are named, and right ones of any rate are not."""

from pathlib import Path

import numpy as np
import pytest

from contactsense.service.recordings import RecordingFile
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.signals.velocity_agreement import MOVEMENTS, VelocityAgreement
from tests.service.recordings.recorded_tables import SCENE, as_parquet, columns

JOINTS = [joint.name for joint in SCENE.robot.joints]


def motion(seconds: float = 6.0, rate: float = 500.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and velocities of joints that swing, each at its own speed, but for the last one."""
    t = 1.7e9 + np.arange(round(seconds * rate)) / rate
    speed = np.array([1.0, 1.3, 1.7, 2.1, 2.5, 0.0])
    phase = np.outer(t - t[0], speed)
    return t, 0.5 * np.sin(phase), 0.5 * speed * np.cos(phase)


def named(t: np.ndarray, q: np.ndarray, qd: np.ndarray, size: int = 1000) -> list[str]:
    """The joints whose velocities are said to be wrong, read in blocks of some size."""
    found = VelocityAgreement(JOINTS)
    for first in range(0, len(t), size):
        rows = slice(first, first + size)
        found.add(t[rows], q[rows], qd[rows])
    return [name for name in JOINTS for problem in found.problems(len(t)) if name in problem.message]


@pytest.mark.parametrize("size", [1, 37, 1000, 10_000])
@pytest.mark.parametrize("factor", [0.0, -1.0, 180.0 / np.pi])
def test_frozen_velocities_and_those_of_another_unit_are_named(factor: float, size: int) -> None:
    t, q, qd = motion()
    wrong = qd.copy()
    wrong[:, 2] *= factor
    assert named(t, q, wrong, size) == JOINTS[2:3]
    assert named(t, q, factor * qd, size) == JOINTS[:5]  # the last one rests


@pytest.mark.parametrize("rate", [10.0, 125.0, 500.0, 1000.0])
def test_right_velocities_are_not(rate: float) -> None:
    assert not named(*motion(rate=rate))


def test_noise_gaps_a_turn_and_missing_numbers_are_no_contradiction() -> None:
    t, q, qd = motion()
    qd += 0.05 * np.random.default_rng(1).standard_normal(qd.shape)
    t[1000:] += 5.0
    t[2000:] -= 20.0
    q[1500:] += 2.0 * np.pi
    qd[700:800], q[900] = np.nan, np.nan
    assert not named(t, q, qd)


def test_a_few_movements_do_not_decide() -> None:
    t, q, qd = motion()
    few = round((MOVEMENTS - 0.5) * 0.25 * 500)
    assert not named(t[:few], q[:few], 0.0 * qd[:few])
    qd[300:500] = 0.0  # a fault of less than a tenth of the time
    assert not named(t, q, qd)


def test_the_reader_of_a_file_names_them(tmp_path: Path) -> None:
    t, q, qd = motion()
    found = columns(len(t)) | {"timestamp": t}
    found |= {f"actual_q_{i}": q[:, i] for i in range(6)}
    right = as_parquet(tmp_path, found | {f"actual_qd_{i}": qd[:, i] for i in range(6)})
    assert not RecordingFile(right, SCENE).read().problems
    frozen = as_parquet(tmp_path, found | {f"actual_qd_{i}": 0.0 * t for i in range(6)})
    (line,) = problem_lines(RecordingFile(frozen, SCENE).read().problems)
    assert line.startswith(
        "rows 0 to 2999: qd: expected the velocities [rad/s] with which q changes, got others"
    )
