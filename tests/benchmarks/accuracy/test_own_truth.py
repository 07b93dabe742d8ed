"""Ground truth of our own making reads and behaves as the given one."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Scene
from contactsense.benchmarks.accuracy.own_truth import FORCES, main, make
from contactsense.benchmarks.accuracy.static_cases import COLUMNS
from contactsense.benchmarks.accuracy.static_points import read
from contactsense.benchmarks.peers.cases import answer, cases, score
from contactsense.benchmarks.peers.method import Located
from contactsense.benchmarks.posterior.samples import of_primitives


def test_our_method_finds_what_was_made() -> None:
    samples = of_primitives(Scene(robot="ur5e"), spacing=0.01)
    points = make("ur5e", 100, 3, samples)
    case = next(cases(points, COLUMNS[:1], ["all"]))
    assert case.base_wrench is not None
    force = np.linalg.norm(case.base_wrench[:, :3], axis=1)
    assert force.min() >= FORCES[0] - 1e-9
    assert force.max() <= FORCES[1] * np.hypot(1.0, 0.5) + 1e-9
    found = score(answer(Located(case.scene), case)[0], points)
    assert found.link_right > 0.9
    assert found.median < 0.001


@pytest.mark.long
def test_the_files_are_those_of_the_given_truth(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        main, [str(tmp_path), "--robot", "ur5e", "--contacts", "4"], catch_exceptions=False
    )
    assert done.exit_code == 0
    points = read(tmp_path, "ur5e")
    assert points.q.shape == (4, 6)
    assert points.gravity == pytest.approx(9.81)
