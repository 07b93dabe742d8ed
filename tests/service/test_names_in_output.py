"""Names of files in the output of commands: printed as they are, whatever characters they have."""

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
