"""Delays that a scene states are taken off the readings of a recording."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Scene, WrenchSensor
from contactsense.service.recordings import RecordingFile, read
from tests.service.recordings.recorded_tables import N, as_parquet, columns, table


def test_the_delay_of_the_base_sensor_is_taken_off(tmp_path: Path) -> None:
    t = np.arange(N) * 0.002
    found = columns(timestamp=t) | {f"base_wrench_{i}": (i + 1.0) * t for i in range(6)}
    late = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=0.01))
    recording = read(as_parquet(tmp_path, found), late)
    expected = (np.arange(6) + 1.0) * (t[:-10, None] + 0.01)
    np.testing.assert_allclose(recording.base_wrench[:-10], expected, atol=1e-9)


@pytest.mark.parametrize("delay", [0.01, -0.01])
@pytest.mark.parametrize("size", [7, 64, 1000])
def test_a_delay_is_taken_off_alike_in_blocks_of_any_size(tmp_path: Path, delay: float, size: int) -> None:
    """Also a negative one, for which readings of the block before are needed."""
    found = columns(300)
    found |= {f"base_wrench_{i}": np.sin(found["timestamp"] * (i + 5.0)) for i in range(6)}
    path = tmp_path / "a.parquet"
    pa_parquet.write_table(pa.table(found), path)
    scene = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=delay))
    recording = RecordingFile(path, scene)
    parts = [(first, _rows(found, first, first + 40)) for first in range(0, 300, 40)]
    recording._table.batches = lambda *_: iter(parts)  # type: ignore[method-assign]
    blocks = list(recording.blocks(size))
    t = np.concatenate([block.t for block in blocks])
    np.testing.assert_array_equal(t, found["timestamp"])
    wrench = np.vstack([block.base_wrench for block in blocks if block.base_wrench is not None])
    inner = slice(10, 290)
    times = t[inner] + delay
    expected = np.column_stack([np.interp(times, t, found[f"base_wrench_{i}"]) for i in range(6)])
    np.testing.assert_allclose(wrench[inner], expected, atol=1e-9)


def test_a_delay_mixes_no_readings_from_before_and_after_a_clock_reset(tmp_path: Path) -> None:
    found = columns(100)
    found["timestamp"] = np.concatenate((500.0 + 0.002 * np.arange(60), 0.002 * np.arange(40)))
    found |= {f"base_wrench_{i}": np.where(np.arange(100) < 60, 1.0, 2.0) for i in range(6)}
    scene = Scene(robot="ur5e", base_wrench=WrenchSensor(delay=0.006))
    recording = read(as_parquet(tmp_path, found), scene)
    np.testing.assert_array_equal(recording.t, found["timestamp"])
    np.testing.assert_allclose(recording.base_wrench, table(found, "base_wrench"))


def _rows(found: dict[str, np.ndarray], first: int, last: int) -> dict[str, np.ndarray]:
    return {name: values[first:last] for name, values in found.items()}
