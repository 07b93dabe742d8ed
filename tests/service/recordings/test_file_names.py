"""Names that are not UTF-8: refused at the start, in one line."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contactsense import Scene
from contactsense.service.analysis.fleet.segments import find_recordings
from contactsense.service.recordings import RecordingError, read
from contactsense.service.recordings.export import write_columns
from contactsense.service.viewer.analysis_source import is_analysis

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux alone")


def test_a_name_that_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.parquet"))
    columns = {"timestamp": np.arange(3.0)}
    with pytest.raises(RecordingError, match=r"caf.xe9.parquet: expected a name in UTF-8: rename it"):
        write_columns(path, columns)
    written = tmp_path / "caf\N{LATIN SMALL LETTER E WITH ACUTE}.parquet"
    write_columns(written, columns)
    written.rename(path)
    for use in (lambda: read(path, Scene(robot="ur5e")), lambda: find_recordings((tmp_path,))):
        with pytest.raises(RecordingError, match="expected a name in UTF-8"):
            use()
    assert not is_analysis(path)


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.arrows", "a.mcap", "a"])
@pytest.mark.parametrize("scene", [None, Scene(robot="ur5e")], ids=["without", "with"])
def test_a_file_that_does_not_exist_is_told_as_such(name: str, scene: Scene | None, tmp_path: Path) -> None:
    """Of an absent MCAP, the scene was missed that none carries."""
    message = f"^{tmp_path / name}: cannot read the recording: No such file or directory$"
    with pytest.raises(RecordingError, match=message):
        read(tmp_path / name, scene)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["record", "--from", "free.csv", "--out", "m\N{LATIN SMALL LETTER U WITH DIAERESIS}.csv"],
        ["analyze", "free.csv", "--out", "m\N{LATIN SMALL LETTER U WITH DIAERESIS}"],
    ],
    ids=lambda words: str(words[0]),
)
def test_a_locale_that_reads_no_utf_8_is_named(words: list[str], tmp_path: Path) -> None:
    own = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-c", "from contactsense.service.cli.main import main; main()", *words]
    ended = subprocess.run(
        list(map(os.fsencode, command)),
        cwd=tmp_path,
        env={**os.environ, **own},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.endswith("names are read as ascii here, expected UTF-8: set LC_ALL=C.UTF-8")
