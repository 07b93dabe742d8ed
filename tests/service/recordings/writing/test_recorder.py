"""Live samples and force/torque readings on disk."""

import shutil
from pathlib import Path

import pyarrow.parquet as pa_parquet

from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.sensors.clients.netft_client import WrenchRecord
from tests.service.recordings.samples import SCENE


def test_readings_of_a_killed_run_are_completed_and_named(tmp_path: Path) -> None:
    killed = Recorder(tmp_path / "killed", SCENE)
    readings = [WrenchRecord(7, 0, (0.0, 1.0, 2.0, 3.0, 4.0, 5.0))]
    killed.wrench(readings)
    killed.flush()
    (left,) = (tmp_path / "killed").iterdir()
    (tmp_path / "again").mkdir()
    shutil.copy(left, tmp_path / "again" / "wrench-0.arrows")  # nobody has it open
    killed.close()
    recorder = Recorder(tmp_path / "again", SCENE)
    recorder.wrench(readings)
    (repaired,) = recorder.repaired
    assert repaired.name == "wrench-0.parquet"
    assert pa_parquet.read_table(repaired).column("tick").to_pylist() == [7.0]
    recorder.close()
