"""The report in a real browser, without internet: it shows its contacts, and its scripts raise no error."""

import shutil
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.browser import browser_page
from contactsense.benchmarks.fleet.dataset import make_recording, plan, write_scenes
from contactsense.service.cli.analyze import analyze
from tests.browser import require_browser
from tests.service.analysis.recordings import demo, write_motion
from tests.service.drawing.test_palette import contrast
from tests.service.loopback import until

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
LONG = "demo" + 8 * "_of_the_cell"
"""Name of a recording that is wider than a narrow screen and has no place to break."""
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


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analysis")
    write_motion(demo(), folder / f"{LONG}.parquet", last=4500)
    (folder / "scene.yaml").write_text("robot: ur5e\n")
    arguments = [str(folder / f"{LONG}.parquet"), "--scene", str(folder / "scene.yaml")]
    result = CliRunner().invoke(analyze, [*arguments, "--out", str(folder / "out")])
    assert result.exit_code == 0, result.output
    (page,) = (folder / "out").rglob("*.html")
    return page


@pytest.mark.slow
def test_the_report_shows_its_contacts(report: Path, tmp_path: Path, browser: str) -> None:
    picture = tmp_path / "page.png"
    done = subprocess.run(
        [browser, *QUIET, f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}", "--dump-dom",
         report.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "forearm" in done.stdout
    assert "<canvas" in done.stdout
    assert "CONSOLE" not in done.stderr, done.stderr
    assert picture.stat().st_size > 20_000


COLOURS = """(() => {
  const hexadecimal = colour => '#' + colour.match(/\\d+/g).slice(0, 3)
    .map(number => (+number).toString(16).padStart(2, '0')).join('');
  const style = name => getComputedStyle(document.querySelector(name));
  const labels = [...document.querySelectorAll('svg text')].map(text => getComputedStyle(text).fill);
  const text = [style('h1').color, style('small').color, ...new Set(labels)];
  return [style('body').backgroundColor, ...text].map(hexadecimal);
})()"""
"""Of the ground, of a heading, of a note, of the labels of all plots."""

SMALLEST = """Math.min(...[...document.querySelectorAll('svg text')]
  .filter(text => text.getClientRects().length)
  .map(text => parseFloat(getComputedStyle(text).fontSize)
    * text.ownerSVGElement.getBoundingClientRect().width / text.ownerSVGElement.viewBox.baseVal.width))"""
"""Size of the smallest label of a plot that is shown [px]."""


OUTSIDE = """[...document.querySelectorAll('svg text')].filter(text => {
  const own = text.getBoundingClientRect(), all = text.ownerSVGElement.getBoundingClientRect();
  const free = 0.2 * Math.min(own.width, own.height);
  const within = [own.top - all.top, own.left - all.left, all.right - own.right, all.bottom - own.bottom];
  return Math.min(...within) < -free;
}).map(text => text.textContent)"""
"""Labels of plots of which a part is cut off. A fifth of a letter's box is free above it, and below it."""


NAMED = """(() => {
  const places = 'h3, dd, li, summary, figcaption, td.text, .scroll td:first-child, .legend span, .lead';
  for (const place of document.querySelectorAll(places))
    place.append(' ' + 'gripper_of_the_second_cell_'.repeat(4));
  const boxes = [document.documentElement, ...document.querySelectorAll('section')];
  return Math.max(...boxes.map(box => box.scrollWidth - box.clientWidth));
})()"""
"""Writes long names without a place to break wherever names are; by how much the page, or the frame around a
contact, is wider than its place then [px]."""


@pytest.mark.slow
def test_a_drawing_is_turned_by_keys_and_the_wheel_scrolls_the_page(report: Path, tmp_path: Path) -> None:
    """Until somebody has chosen the drawing."""
    require_browser()
    wheel = "canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: 100, cancelable: true}))"
    with browser_page(report.as_uri(), tmp_path) as (page, _):
        page.wait_for("Contacts in demo")
        page.evaluate("canvas = document.querySelector('canvas'), 0")
        pictures = [page.evaluate("canvas.toDataURL()")]
        assert page.evaluate(wheel)  # the browser does what it always does
        page.evaluate("canvas.focus()")
        for key in ("ArrowRight", "ArrowUp", "-"):
            page.key(key)
            assert until(lambda: page.evaluate("canvas.toDataURL()") not in pictures)
            pictures.append(page.evaluate("canvas.toDataURL()"))
        assert not page.evaluate(wheel)
        assert until(lambda: page.evaluate("canvas.toDataURL()") not in pictures)
        page.evaluate("document.querySelector('table a').click()")
        assert page.evaluate("document.querySelector(location.hash + ' h3').innerText").startswith(
            "Contact 1:"
        )
        assert page.errors() == []


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of one robot on three days, with charts of its drift."""
    folder = tmp_path_factory.mktemp("fleet")
    write_scenes(folder / "data", 1)
    for task in plan(folder / "data", 3, 1, 12.0):
        make_recording(task)
    recording = next((folder / "data").rglob("*.parquet"))
    recording.with_name(f"{LONG}.parquet").write_bytes(b"broken")
    result = CliRunner().invoke(analyze, [str(folder / "data"), "--out", str(folder / "out")])
    assert result.exit_code == 1, result.output
    return folder / "out" / "fleet.html"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "title"), [("report", "Contacts in demo"), ("fleet", "Contacts of a fleet")]
)
def test_they_can_be_read_in_light_and_dark_on_a_wide_and_a_narrow_screen(
    name: str, title: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    require_browser()
    page_file: Path = request.getfixturevalue(name)
    with browser_page(page_file.as_uri(), tmp_path) as (page, _):
        page.wait_for(title)
        for width, dark in ((1280, False), (400, True), (1280, True)):
            page.imitate(width, 900, dark)
            ground, heading, note, *labels = page.evaluate(COLOURS)
            assert (contrast(ground, "#000000") < 2.0) == dark
            assert contrast(heading, ground) >= 7.0
            assert labels
            assert min(contrast(text, ground) for text in (note, *labels)) >= 4.5  # WCAG 2.2, 1.4.3
            assert page.evaluate(SMALLEST) >= 9.0
            assert page.evaluate(OUTSIDE) == []
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        for width in (1280, 400):
            page.imitate(width, 900, False)
            assert page.evaluate(NAMED) <= 0
