"""`contactsense bench smoothing` on ground truth: the second look is better over whole contacts."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.motion.smoothing import smoothing
from tests.shared import shared


@pytest.mark.slow
def test_over_whole_contacts_the_second_look_is_better() -> None:
    folder = shared("truth/motion_ur5e.npz").parent
    result = CliRunner().invoke(smoothing, [str(folder), "--robot", "ur5e", "--level", "2", "--json"])
    assert result.exit_code == 0, result.output
    found = next(row for row in json.loads(result.stdout)["results"] if row["kind"] == "all")
    assert found["contacts"] >= 30
    assert found["link_right_smoothed"] >= found["link_right_live"] - 0.05
    assert found["error_mm_smoothed_all"]["median"] < found["error_mm_live_all"]["median"]
