"""Real touches on a Panda: one measurement per touch, the usual rule, and what torques alone can tell."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks import panda
from contactsense.benchmarks.franka.command import answer, drift_beyond, franka
from contactsense.benchmarks.franka.touches import last_joint_above, loaded, read
from contactsense.benchmarks.statistics.reliability import reliability
from tests.shared import shared


def test_the_rule_names_the_last_joint_above() -> None:
    torque = np.array([[1.0, -0.5, 0.1], [0.1, 0.1, 0.1], [0.1, 0.0, -0.3]])
    np.testing.assert_array_equal(last_joint_above(torque, 0.2), [2, 0, 3])
    np.testing.assert_array_equal(last_joint_above(torque, np.array([0.2, 0.6, 0.05])), [3, 3, 3])


def test_a_touch_is_its_largest_change_from_its_own_baseline(tmp_path: Path) -> None:
    """Two touches: the second is without load."""
    torque = np.zeros((6, 7))
    torque[:, 0] = 0.9
    torque[1, 3], torque[2, 3] = 0.4, 0.5
    torque[4, 6] = 0.02
    np.savez(
        tmp_path / "franka_links.npz",
        q=np.arange(42.0).reshape(6, 7),
        tau_ext=torque,
        label=np.array([0, 1, 1, 0, 1, 1]),
        link=np.array([4, 4, 4, 7, 7, 7]),
        touch=np.array([0, 0, 0, 1, 1, 1]),
        names=np.array(["a", "b"]),
    )
    touches = read(tmp_path)
    assert touches.name == ("a", "b")
    np.testing.assert_allclose(touches.torque[0], [0, 0, 0, 0.5, 0, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(touches.q[0], np.arange(14.0, 21.0))
    assert loaded(touches).name == ("a",)
    assert drift_beyond(touches)[4:].tolist() == [0.0, 0.0, 0.0]


def test_without_the_recordings_it_says_so(tmp_path: Path) -> None:
    result = CliRunner().invoke(franka, [str(tmp_path)])
    assert result.exit_code == 1
    assert "franka_links.npz: no such recording" in result.output


@pytest.mark.slow
def test_more_touched_links_are_named_than_by_the_usual_rule() -> None:
    folder = shared("franka_links")
    try:
        panda.urdf()
    except panda.NoPandaError as error:
        pytest.skip(str(error))
    every = read(folder)
    touches = loaded(every)
    answers = answer(touches)
    assert len(every.link) == 18
    assert len(touches.link) == 15
    assert answers.named.sum() >= 12 > answers.own.sum() > answers.fixed.sum()
    assert answers.listed.sum() >= 14
    # No clear answer is wrong; where torques alone cannot tell, the answer is `ambiguous`.
    assert answers.named[answers.clear].all()
    trust = reliability(answers.stated, answers.named)
    assert trust.error < trust.by_chance_95
    # The drift that the scene states is not smaller than that of joints which measure nothing.
    beyond = drift_beyond(every)
    assert np.nanmax(beyond) < 1.0
    plain = json.loads(CliRunner().invoke(franka, [str(folder), "--json"]).output)
    assert plain["touches"] == 15
    assert sum(plain["named"]) == answers.named.sum()
