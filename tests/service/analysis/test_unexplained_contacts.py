"""A push that no place of the arm explains has the force that the base sensor measures."""

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.service.analysis.analysis import AnalysisRun
from contactsense.service.analysis.contact_table import contact_rows
from contactsense.service.recordings import Recording
from tests.plain_arm import plain_ur5e

SCENE = Scene(
    robot=plain_ur5e(), base_wrench=WrenchSensor(force_noise=0.3, moment_noise=0.05), joint_torque=None
)
Q = np.array([0.3, -1.2, 0.8, 0.4, -1.0, 0.5])


def _recording(point: tuple[float, ...], force: tuple[float, ...]) -> Recording:
    t = np.arange(0.0, 4.0, 0.002)
    wrench = np.tile(ArmWeight(SCENE).wrench(Q), (len(t), 1))
    wrench += np.random.default_rng(0).standard_normal(wrench.shape) * np.repeat([0.3, 0.05], 3)
    wrench[(t > 2.0) & (t < 2.6)] += np.concatenate((force, np.cross(point, force)))
    q, rows = np.tile(Q, (len(t), 1)), np.arange(len(t))
    return Recording("r", t, q, np.zeros_like(q), None, wrench, None, rows)


@pytest.fixture(scope="module")
def run() -> AnalysisRun:
    return AnalysisRun(SCENE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("point", "force"),
    [
        ((0.0, 0.1, 1.6), (30.0, 0.0, 0.0)),
        ((0.5, 0.5, 0.9), (0.0, 0.0, -40.0)),
        ((-0.4, 0.3, 0.3), (20.0, 20.0, 20.0)),
        ((1.2, 0.0, 1.2), (0.0, 60.0, 0.0)),
    ],
)
def test_a_line_of_action_that_misses_the_arm(
    run: AnalysisRun, point: tuple[float, ...], force: tuple[float, ...]
) -> None:
    (found,) = run.contacts(_recording(point, force))
    size = np.linalg.norm(force)
    assert found.probability < 0.2
    assert found.peak_force == pytest.approx(size, abs=1.0)
    assert found.impulse == pytest.approx(0.6 * size, rel=0.03)
    np.testing.assert_allclose(found.force_base, force, atol=1.0)
    # Without a place nothing is known of what the arm does there: 0 would be an arm at rest.
    (row,) = contact_rows((found,))
    assert [row[name] for name in ("point_x", "torsion", "speed")] == [None, None, None]
