"""A recording in a real browser: it plays, and the slider moves it."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from contactsense.benchmarks.browser import Page, browser_page
from contactsense.service.viewer import READY
from tests.browser import require_browser
from tests.service.analysis.recordings import demo, write_motion

pytestmark = pytest.mark.slow
PATIENCE = 120.0
"""Longest time for the recording to be estimated, and for the page to follow [s]."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    require_browser()
    folder = tmp_path_factory.mktemp("recording")
    write_motion(demo(), folder / "demo.parquet", last=3000)
    (folder / "scene.yaml").write_text("robot: ur5e\n")
    arguments = ["view", str(folder / "demo.parquet"), "--scene", str(folder / "scene.yaml"), "--port", "0"]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "contactsense", *arguments], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith(READY)
        with browser_page(line.removeprefix(READY).strip(), folder / "profile") as (page, _):
            page.wait_for("demo.parquet: ")
            yield page
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def at(page: Page) -> float:
    """Time in the recording that the page shows [s]."""
    found = re.search(r"demo\.parquet: ([\d.]+) s of 6\.0 s", page.text())
    assert found is not None, page.text()
    return float(found[1])


def wait_until(page: Page, time_shown: float) -> None:
    end = time.monotonic() + PATIENCE
    while not at(page) >= time_shown:
        assert time.monotonic() < end, page.text()
        time.sleep(0.2)


def test_the_list_of_contacts_asks_to_choose_one(page: Page) -> None:
    assert "Recording" in page.text()
    values = page.evaluate("[...document.querySelectorAll('input')].map((input) => input.value)")
    assert "choose one" in values


def test_every_control_has_a_name_for_screen_readers(page: Page) -> None:
    """viser names only the first control of a row, and no slider."""
    controls = "[...document.querySelectorAll('[role=slider], input[type=text]')]"
    names = f"{controls}.map((one) => one.ariaLabel || one.labels?.[0]?.textContent || '')"
    end = time.monotonic() + PATIENCE
    while "" in (found := page.evaluate(names)):
        assert time.monotonic() < end, found
        time.sleep(0.5)
    assert found.count("Time, s") == 2  # the slider, and the number beside it
    bases = [name for name in found if name.startswith("Base")]
    assert bases == ["Base, deg x", "Base, deg y", "Base, deg z"]


def test_it_plays_to_its_end(page: Page) -> None:
    assert at(page) == 0.0
    assert "is touched" not in page.text()
    page.press("Play")
    wait_until(page, 6.0)
    page.wait_for("Play")


def test_the_slider_leads_back_to_the_beginning(page: Page) -> None:
    end = time.monotonic() + PATIENCE
    while at(page) > 0.0:
        assert time.monotonic() < end, page.text()
        # On a busy computer a single key may have no effect; a user would press it again.
        page.evaluate("document.querySelector('[role=slider]').focus()")
        page.key("Home")
        time.sleep(1.0)
    assert "forearm is touched" not in page.text()


def test_a_contact_can_be_chosen_again(page: Page) -> None:
    for _ in range(2):
        test_the_slider_leads_back_to_the_beginning(page)
        page.wait_for("demo.parquet: 0.0 s")
        values = "[...document.querySelectorAll('input')].map((input) => input.value)"
        end = time.monotonic() + PATIENCE
        while "choose one" not in page.evaluate(values):
            assert time.monotonic() < end
            time.sleep(0.2)
        page.choose("Contact", "1: 3.0 s forearm")
        wait_until(page, 2.5)
        assert at(page) == 2.5


def test_it_reports_no_error(page: Page) -> None:
    assert page.errors() == []
