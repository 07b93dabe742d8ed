"""The picture of time against error: marks, table, drawing."""

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from contactsense.benchmarks.peers.added_contacts import add
from contactsense.benchmarks.peers.cases import static_cases
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.pictures.mark import Mark, draw, table
from contactsense.benchmarks.speed_error import mark
from contactsense.benchmarks.static_truth.cases import COLUMNS
from tests.shared import shared


class Oracle:
    """Answers 3 mm beside the truth, and not at all to every fifth sample."""

    def __init__(self, point: np.ndarray, link: np.ndarray) -> None:
        self.name = "oracle"
        self._point, self._link = point, link

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        n = len(q)
        link = np.where(np.arange(n) % 5 == 4, -1, self._link[:n])
        return Answers(link, self._point[:n] + np.array([0.003, 0.0, 0.0]))


def test_marks_count_missing_answers() -> None:
    case = next(static_cases("ur5e", COLUMNS[:1], ["all"], rows=slice(0, 50), folder=shared("truth")))
    found = mark(Oracle(case.points.point_base, case.points.link), case)
    assert found.error[:2] == (np.float64(found.error[0]), np.float64(found.error[0]))
    assert abs(found.error[0] - 0.003) < 1e-12
    assert found.error[2] == np.inf
    assert found.link_right == 0.8
    assert found.as_json()["error"][2] is None


@pytest.mark.slow
def test_the_picture_and_the_table_show_every_mark(tmp_path: Path) -> None:
    marks = [
        Mark(name, robot, noise, contacts, 10.0 ** (k + 1), (0.001, 0.002, np.inf if k else 0.01), 0.9)
        for k, name in enumerate(("quick", "slow"))
        for robot in ("ur5e", "ur10e")
        for noise in COLUMNS[:2]
        for contacts in (1, 3)
    ]
    draw(marks, tmp_path / "marks.png")
    assert (tmp_path / "marks.png").stat().st_size > 10_000
    console = Console(width=110, file=io.StringIO())
    console.print(table(marks, 7))
    text = console.file.getvalue()
    assert text.count("quick") == text.count("slow") == 8
    assert "1.0 / 2.0 / 10.0" in text
    assert "1.0 / 2.0 / none" in text


def test_further_contacts_join_those_of_the_ground_truth() -> None:
    folder = shared("truth")
    case = next(static_cases("ur5e", COLUMNS[:1], ["all"], rows=slice(0, 12), folder=folder))
    touches = add(case.points, 2, folder)
    np.testing.assert_array_equal(touches.point_base[:, 0], case.points.point_base)
    np.testing.assert_allclose(touches.base_wrench[:, 0], case.base_wrench, atol=1e-6)
    np.testing.assert_allclose(touches.joint_torque[:, 0], case.joint_torque, atol=1e-6)
    for links in touches.link:
        assert len(set(links)) == 3
    force = touches.force_base[:, 1:]
    np.testing.assert_allclose(np.linalg.norm(force, axis=-1), 20.0)
    assert ((force * touches.normal_base[:, 1:]).sum(axis=-1) < 0.0).all()
    moment = np.cross(touches.point_base[:, 1:], force)
    np.testing.assert_allclose(touches.base_wrench[:, 1:], np.concatenate((force, moment), axis=-1))
