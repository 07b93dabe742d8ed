"""Regions of a further contact on the visual meshes, beside one whose force is free."""

import pytest

from contactsense.benchmarks.multi_contact.calibration import SCENARIOS, judge
from contactsense.benchmarks.multi_contact.calibration_summary import summarize
from contactsense.benchmarks.multi_contact.measure import localizer_for
from contactsense.benchmarks.multi_contact.mesh_trials import MeshTrials
from contactsense.benchmarks.static_truth.cases import COLUMNS
from tests.shared import shared

pytestmark = pytest.mark.slow  # its kernels compile for long


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_a_further_contact_is_where_its_region_says(robot: str) -> None:
    """Its place is spread along a curved surface about an optimum that is not its mean."""
    noise, arriving = COLUMNS[1], "forces free"
    localizer = localizer_for(robot, noise, detail="coarse")
    trials = MeshTrials(localizer.scene, 1, shared("truth"), robot)
    verdicts = list(judge(localizer, noise, 1000, 2, SCENARIOS[arriving], trials=trials))
    found = summarize(robot, noise, 2, arriving, verdicts)
    assert found.counted > 0.98
    assert 0.88 <= found.last.found <= 0.92
    assert found.earlier.found >= 0.87
