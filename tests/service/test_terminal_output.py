"""The output of commands in terminals: names of any characters, numbers in a narrow window."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.cli.analyze import analyze
from tests.service.analysis.recordings import demo, write_motion

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("folder", "name"), [("cell", "run [left].parquet"), ("cell [", "left].parquet")], ids=["begin", "end"]
)
def test_brackets_are_no_markup(
    folder: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """rich takes [left] for a style, which it leaves out, and [/left] for the end of one, an error."""
    monkeypatch.chdir(tmp_path)
    recording = Path(folder, name)
    recording.parent.mkdir()
    write_motion(demo(), recording, last=1000)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    arguments = [str(recording), "--scene", "scene.yaml", "--out", f"{folder}[b]"]
    assert CliRunner().invoke(analyze, arguments).output.splitlines()[-2:] == [
        f"{recording}: 2.0 s, nothing touched the arm",
        f"report: {Path(f'{folder}[b]', 'report.html')}",
    ]


def test_no_number_is_cut_off_in_a_narrow_terminal(tmp_path: Path) -> None:
    """Nor in a usual one, where times since 1970 need more room than the table has."""
    write_motion(demo(), tmp_path / "run.parquet", first=1000, last=2400)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    command = [sys.executable, "-m", "contactsense", "analyze", "run.parquet"]
    ours, theirs = pty.openpty()
    try:
        subprocess.run(
            [*command, "--scene", "scene.yaml", "--out", "out"],
            cwd=tmp_path, env=os.environ | {"TERM": "xterm", "COLUMNS": "50"},
            stdout=theirs, stderr=subprocess.DEVNULL, check=True, timeout=300,
        )  # fmt: skip
        os.set_blocking(ours, False)
        printed = os.read(ours, 65536).decode()
    finally:
        os.close(ours)
        os.close(theirs)
    assert "-175, 37, " in printed
    assert "\N{HORIZONTAL ELLIPSIS}" not in printed
