"""How predictions and simulation are compared."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.benchmarks.accuracy.surface_map import Agreement, summary, surface_map
from contactsense.benchmarks.static_truth.cases import COLUMNS

PART = Agreement(
    share=np.array([0.5, 0.2, 0.2, 0.1]),
    force_ratio=np.array([1.0, 1.19, 0.0, np.nan]),
    error_ratio=np.array([0.79, 1.2, np.nan, np.nan]),
    link_difference=np.array([0.0, -0.1, 0.1, 0.2]),
)


def test_agreement_counts_surface_with_a_prediction() -> None:
    found = summary([PART, PART])
    assert found["force_within"] == pytest.approx(0.7 / 0.9)
    assert found["error_within"] == pytest.approx(0.2 / 0.7)
    assert found["error_told"] == pytest.approx(0.7)
    assert found["link_difference"] == pytest.approx(0.06)


def test_no_prediction_at_all_is_no_agreement() -> None:
    found = summary([PART._replace(error_ratio=np.full(4, np.nan))])
    assert found["error_within"] is None
    assert found["error_ratio"] is None
    assert found["error_told"] == 0.0


@pytest.mark.long
def test_the_command_compares_the_chosen_sensors() -> None:
    chosen = ["--robot", "ur5e", "--sensors", "all", "--postures", "1", "--draws", "40", "--every", "80"]
    done = CliRunner().invoke(surface_map, [*chosen, "--json"])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)
    assert [(row["robot"], row["noise"], row["sensors"]) for row in rows] == [
        ("ur5e", str(noise), "all") for noise in COLUMNS[1:]
    ]
    for row in rows:
        assert row["force_within"] > 0.5
        # A sum of weights that add up to one.
        assert row["error_told"] == pytest.approx(1.0, abs=1e-12)
