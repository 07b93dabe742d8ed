"""One table of readings in every format that is read."""

import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather as pa_feather
import pyarrow.parquet as pa_parquet

from contactsense import Scene, WrenchSensor

N = 50
"""Rows of the table."""
SCENE = Scene(
    robot="ur5e",
    base_wrench=WrenchSensor(rpy=(0.1, 0.2, 0.3), translation=(0.0, 0.0, -0.05), sign="sensor_on_arm"),
)
TORQUES = Scene(robot="ur5e", base_wrench=None)
"""Scenes of an arm with and without a base sensor."""


def columns(n: int = N, **more: np.ndarray) -> dict[str, np.ndarray]:
    chance = np.random.default_rng(1)
    found = {"timestamp": np.arange(n) * 0.002 + 100.0}
    for group in ("actual_q", "actual_qd", "joint_torque", "base_wrench"):
        found |= {f"{group}_{i}": np.round(chance.standard_normal(n), 6) for i in range(6)}
    return found | more


def table(found: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.column_stack([found[f"{name}_{i}"] for i in range(6)])


def text(found: dict[str, np.ndarray], delimiter: str = ",") -> str:
    rows = [delimiter.join(found)]
    rows += [delimiter.join(f"{value:.6f}" for value in row) for row in zip(*found.values(), strict=True)]
    return "\n".join(rows) + "\n"


def as_csv(path: Path, found: dict[str, np.ndarray]) -> Path:
    (path / "a.csv").write_text(text(found))
    return path / "a.csv"


def as_blanks(path: Path, found: dict[str, np.ndarray]) -> Path:
    (path / "a.csv").write_text(text(found, " "))
    return path / "a.csv"


def as_gzip(path: Path, found: dict[str, np.ndarray]) -> Path:
    (path / "a.csv.gz").write_bytes(gzip.compress(text(found).encode()))
    return path / "a.csv.gz"


def as_parquet(path: Path, found: dict[str, np.ndarray]) -> Path:
    pa_parquet.write_table(pa.table(found), path / "a.parquet")
    return path / "a.parquet"


def as_folder(path: Path, found: dict[str, np.ndarray]) -> Path:
    whole, folder = pa.table(found), path / "robot=left" / "date=2026-01-01"
    folder.mkdir(parents=True)
    pa_parquet.write_table(whole[:20], folder / "part-0.parquet")
    pa_parquet.write_table(whole[20:], folder / "part-1.parquet")
    return path / "robot=left"


def as_feather(path: Path, found: dict[str, np.ndarray]) -> Path:
    pa_feather.write_feather(pa.table(found), path / "a.feather")
    return path / "a.feather"


def as_arrow(path: Path, found: dict[str, np.ndarray]) -> Path:
    whole = pa.table(found)
    with pa.OSFile(str(path / "a.arrows"), "wb") as sink, pa.ipc.new_stream(sink, whole.schema) as stream:
        stream.write_table(whole, max_chunksize=16)
    return path / "a.arrows"
