"""Change over the days of a robot."""

import numpy as np

from contactsense.service.analysis.fleet.drift import daily_mean, daily_median
from contactsense.service.drawing.drift_svg import drift_chart

DATES = [f"2026-01-{day:02d}" for day in range(1, 31)]


def test_drift_is_the_trend_from_the_first_day_to_the_last_and_outliers_do_not_matter() -> None:
    chance = np.random.default_rng(1)
    values = [[2.0 + 0.1 * i + 0.05 * chance.standard_normal(), 1.0] for i in range(30)]
    values[7][0] = 100.0
    daily = daily_median(DATES, values)
    np.testing.assert_allclose(daily.drift, [2.9, 0.0], atol=0.1)


def test_days_that_are_far_apart_count_as_such() -> None:
    daily = daily_median(["2026-01-01", "2026-01-02", "2026-01-31"], [[0.0], [1.0], [30.0]])
    np.testing.assert_allclose(daily.drift, [30.0])


def test_a_day_weighs_its_segments_by_their_variance_and_leaves_out_what_is_not_known() -> None:
    daily = daily_mean(
        ["b", "a", "a", "a"], [[7.0, None], [1.0, None], [4.0, None], [None, 2.0]],
        [[1.0, None], [1.0, None], [0.5, None], [None, 1.0]],
    )  # fmt: skip
    assert daily.dates == ("a", "b")
    np.testing.assert_allclose(daily.values, [[3.4, 2.0], [7.0, np.nan]])
    np.testing.assert_allclose(daily.drift, [3.6, np.nan])


def test_a_recording_without_a_date_is_on_no_day() -> None:
    daily = daily_median(["unknown", "2026-01-01", "2026-01-31"], [[9.0], [1.0], [2.0]])
    assert daily.dates == ("2026-01-01", "2026-01-31", "unknown")
    np.testing.assert_allclose(daily.drift, [1.0])


def test_the_chart_shows_each_joint_and_zero() -> None:
    values = np.array([[0.5, -0.2], [np.nan, -0.1], [0.7, 0.1]])
    chart = drift_chart(["2026-01-01", "", "2026-01-03"], values, ["elbow", "<wrist>"], "Nm", "friction")
    assert chart.count("<polyline") == 2
    assert ">0<" in chart
    assert "&lt;wrist&gt;" in chart
    assert "2026-01-03" in chart
