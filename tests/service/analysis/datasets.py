"""Datasets for the tests of fleets."""

from pathlib import Path

import pyarrow.parquet as pa_parquet

from contactsense.scene import Scene
from contactsense.service.recordings.metadata import metadata
from tests.service.analysis.recordings import demo, write_motion


def dataset(folder: Path, rounds: int = 1) -> Path:
    """Two robots, three recordings and a broken one."""
    for robot, date in (("a", "2026-01-01"), ("a", "2026-01-02"), ("b", "2026-01-01")):
        here = folder / f"robot={robot}" / f"date={date}"
        here.mkdir(parents=True)
        write_motion(demo(), here / "one.parquet", rounds)
    (folder / "robot=b" / "date=2026-01-01" / "two.parquet").write_bytes(b"broken")
    return folder


def carrying(folder: Path, robot: str, *scenes: Scene | None) -> None:
    """Recordings of a robot that carry these scenes; None: a broken file."""
    here = folder / f"robot={robot}"
    here.mkdir(parents=True)
    for i, scene in enumerate(scenes):
        path = here / f"{i}.parquet"
        write_motion(demo(), path, last=2300)
        if scene is None:
            path.write_bytes(b"broken")
        else:
            table = pa_parquet.read_table(path)
            pa_parquet.write_table(table.replace_schema_metadata(metadata(scene)), path)
