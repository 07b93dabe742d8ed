"""`contactsense record`: how long and how large its files become."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense.service.cli import record
from contactsense.service.recordings.writing import segment_writer
from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.sensors.clients.robot_stream import RobotRecord, StreamHealth
from contactsense.service.sensors.source_health import SourceHealth

COLUMNS = 100
"""Values of a packet: with what is added to them, 1087 packets are a megabyte."""


class Packets:
    """A source that delivers 3000 packets, 20 ms apart: a minute."""

    observer: Recorder
    health = SourceHealth(StreamHealth("streaming"), None, 0, 0)
    now = 0.0

    def __init__(self, *_: object) -> None:
        self._values = np.random.default_rng(1).standard_normal((3000, COLUMNS))

    def poll(self, timeout: float) -> None:
        for i, row in enumerate(self._values):
            Packets.now = 0.02 * i
            packet = RobotRecord(Packets.now, 0, tuple(row))
            self.observer.robot(packet, {"signal": slice(0, COLUMNS)}, None, 0.0, None)
            if i % 10 == 9:
                self.observer.flush()  # otherwise the thread that writes would read a later time
        raise KeyboardInterrupt

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("options", "files", "rows"),
    [
        ([], 1, 3000),
        (["--rotate-seconds", "20"], 3, 3000),
        (["--rotate-mb", "1"], 3, 3000),
        (["--rotate-mb", "1", "--disk-limit-mb", "2"], 2, 1910),
    ],
)
def test_files_begin_anew_and_the_oldest_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], files: int, rows: int
) -> None:
    clock = SimpleNamespace(**{name: getattr(segment_writer.time, name) for name in ("gmtime", "strftime")})
    clock.monotonic = lambda: Packets.now
    monkeypatch.setattr(segment_writer, "time", clock)
    monkeypatch.setattr(record, "LiveSource", Packets)
    robot = ["--robot-host", "192.0.2.1", "--ft-host", "192.0.2.2"]
    done = CliRunner().invoke(record.record, [*robot, "--out", str(tmp_path / "Zelle Süd"), *options])
    assert done.exit_code == 0, done.output
    found = [pa_parquet.read_table(path) for path in (tmp_path / "Zelle Süd").iterdir()]
    assert len(found) == files
    assert sum(map(len, found)) == rows
    assert ("to keep --disk-limit-mb: 1 file" in done.output) == ("--disk-limit-mb" in options)


@pytest.mark.parametrize("option", ["--rotate-seconds", "--rotate-mb", "--disk-limit-mb"])
@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "", "much"])
def test_sizes_that_cannot_be_are_refused(tmp_path: Path, option: str, value: str) -> None:
    done = CliRunner().invoke(record.record, ["--out", str(tmp_path / "x"), option, value])
    assert done.exit_code == 2
    assert option in done.output
    assert not list(tmp_path.iterdir())
