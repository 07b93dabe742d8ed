"""How predictions and simulation are compared."""

import numpy as np
import pytest

from contactsense.benchmarks.accuracy.surface_map import Agreement, summary

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
