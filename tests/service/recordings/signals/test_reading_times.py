"""Readings of sensors at the times of the rows: none where nobody measured, none twice."""

from pathlib import Path

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.service.recordings import read
from contactsense.service.recordings.signals.reading_times import readings_at
from tests.service.recordings.recorded_tables import as_parquet, columns, table

T = 0.002 * np.arange(500)


def _line(stamps: np.ndarray) -> np.ndarray:
    return np.outer(stamps, np.arange(1.0, 7.0))


@pytest.mark.parametrize("rate", [500.0, 7000.0])
def test_a_sensor_that_is_fast_enough_has_a_reading_in_each_row(rate: float) -> None:
    stamps = np.arange(-0.01, 1.1, 1.0 / rate)
    np.testing.assert_allclose(readings_at(T, stamps, _line(stamps)), _line(T), atol=1e-12)


def test_while_a_sensor_is_silent_it_has_no_readings() -> None:
    stamps = T[(T < 0.3) | (T > 0.7)] + 1e-4
    found = readings_at(T, stamps, _line(stamps))
    silent = np.isnan(found).all(axis=1)
    np.testing.assert_array_equal(silent, (T < 1e-4) | ((T >= 0.3) & (T < 0.701)))
    np.testing.assert_allclose(found[~silent], _line(T)[~silent], atol=1e-12)
    assert np.isnan(readings_at(T, np.zeros(0), np.zeros((0, 6)))).all()


@pytest.mark.parametrize("missing", [5, 9, 13])
def test_rows_between_readings_that_were_lost_have_none(missing: int) -> None:
    """Interpolated, all of them would have the noise of two readings, which looks like a contact."""
    lost = (np.arange(len(T)) >= 200) & (np.arange(len(T)) < 200 + missing)
    stamps = T[~lost]
    found = readings_at(T, stamps, _line(stamps))
    np.testing.assert_array_equal(np.isnan(found).all(axis=1), lost)


def test_readings_that_come_in_bursts_leave_no_row_without_one() -> None:
    bursts = np.arange(-0.008, 1.1, 0.008)
    stamps = (bursts[:, None] + np.arange(8) * 1e-4).ravel()
    np.testing.assert_allclose(readings_at(T, stamps, _line(stamps)), _line(T), atol=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.0007, -0.0007])
def test_each_reading_of_a_slower_sensor_is_used_once(shift: float) -> None:
    stamps = T[5::5] + shift
    order = np.random.default_rng(1).permutation(len(T))
    found = readings_at(T[order], stamps, _line(stamps))
    there = np.isfinite(found).all(axis=1)
    inside = (T[5::5] >= stamps[0]) & (T[5::5] <= stamps[-1])
    np.testing.assert_allclose(np.sort(T[order][there]), T[5::5][inside])
    np.testing.assert_allclose(found[there], _line(T[order][there]), atol=1e-12)


def test_a_sensor_that_is_slower_than_the_rows_may_be_late(tmp_path: Path) -> None:
    """Between two of its readings there is nothing to interpolate with."""
    late, count = 0.003, 1000
    found = columns(count)
    t = found["timestamp"]
    readings = _line(t - late)
    readings[np.arange(count) % 5 != 0] = np.nan
    found |= {f"base_wrench_{i}": readings[:, i] for i in range(6)}
    scene = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=late))
    recording = read(as_parquet(tmp_path, found), scene)
    assert recording.base_wrench is not None
    there = np.isfinite(recording.base_wrench).all(axis=1)
    assert count // 5 - 2 <= there.sum() <= count // 5
    np.testing.assert_allclose(recording.base_wrench[there], _line(t)[there], rtol=1e-6)
    np.testing.assert_allclose(recording.joint_torque, table(found, "joint_torque"))
