"""Commands do not write over the recording that they read."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from contactsense.service.cli.analyze import analyze
from contactsense.service.cli.calibrate import calibrate
from contactsense.service.cli.record import record


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (analyze, ["contacts.csv", "--scene", "scene.yaml", "--out", "."]),
        (analyze, ["estimates.parquet", "--scene", "scene.yaml", "--out", ".", "--estimates"]),
        (calibrate, ["free.csv", "--scene", "scene.yaml", "--out", "link.csv"]),
        (record, ["--from", "free.csv", "--scene", "scene.yaml", "--out", "link.csv"]),
    ],
)
def test_a_recording_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: click.Command, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text("robot: ur5e\n")
    recordings = [Path(name) for name in ("contacts.csv", "estimates.parquet", "free.csv")]
    for path in recordings:
        path.write_text("not to be lost")
    Path("link.csv").symlink_to("free.csv")
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 1
    assert "--out: expected another place than that of" in result.output
    assert [path.read_text() for path in recordings] == ["not to be lost"] * 3
