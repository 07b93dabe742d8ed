"""The report in a real browser, without internet: it shows its contacts, and its scripts raise no error."""

import shutil
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.service.cli.analyze import analyze
from tests.service.analysis.recordings import demo, write_motion

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-logging=stderr", "--virtual-time-budget=10000", "--window-size=1200,1600",
)  # fmt: skip


@pytest.fixture(scope="module")
def browser() -> str:
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is installed")
    return found


@pytest.mark.slow
def test_the_report_shows_its_contacts(tmp_path: Path, browser: str) -> None:
    write_motion(demo(), tmp_path / "demo.parquet", last=4500)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    arguments = [str(tmp_path / "demo.parquet"), "--scene", str(tmp_path / "scene.yaml")]
    result = CliRunner().invoke(analyze, [*arguments, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    (page,) = (tmp_path / "out").rglob("*.html")
    picture = tmp_path / "page.png"
    done = subprocess.run(
        [browser, *QUIET, f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}", "--dump-dom",
         page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "forearm" in done.stdout
    assert "<canvas" in done.stdout
    assert "CONSOLE" not in done.stderr, done.stderr
    assert picture.stat().st_size > 20_000
