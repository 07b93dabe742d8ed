"""The viewer in a real browser: it tells what is known, and needs nobody else."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from contactsense.benchmarks.browser import browser_page
from contactsense.scene import Scene
from tests.browser import require_browser
from tests.service.loopback import until
from tests.service.viewer.estimates import POSTURE, contact, estimate
from tests.service.viewer.shown import PATIENCE, Shown, showing

pytestmark = pytest.mark.slow
SCENE = Scene(robot="ur5e")
FOREARM = 3
PLACES = (np.array([-0.2, 0.05, 0.007]), np.array([-0.12, -0.05, 0.007]))
"""On the forearm, on opposite sides, in its frame [m]."""


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    require_browser()
    with showing(SCENE, tmp_path_factory.mktemp("profile")) as shown:
        yield shown


def test_the_words_tell_all_explanations(shown: Shown) -> None:
    shown.estimate = estimate(
        SCENE,
        contact(SCENE, POSTURE, FOREARM, PLACES[0], probability=0.6),
        contact(SCENE, POSTURE, 2, PLACES[1], probability=0.3),
        status="ambiguous",
    )
    shown.page.wait_for("Ambiguous: 2 explanations")
    text = shown.page.text()
    for expected in ("60 %", "30 %", "none of these", "10 %", "upper_arm"):
        assert expected in text


@pytest.mark.long
def test_a_browser_that_hangs_holds_up_nobody(shown: Shown, tmp_path: Path) -> None:
    url = f"http://127.0.0.1:{shown.server.get_port()}"
    with browser_page(url, tmp_path) as (_, process):
        assert until(lambda: len(shown.server.get_clients()) == 2, PATIENCE)
        os.killpg(process.pid, signal.SIGSTOP)
        for link in (1, 2, FOREARM):
            shown.estimate = estimate(SCENE, contact(SCENE, POSTURE, link, PLACES[0]))
            shown.page.wait_for(f"{SCENE.link_names[link]} is touched")


def test_the_page_needs_no_other_computer_and_reports_no_error(shown: Shown) -> None:
    assert shown.page.errors() == []
    assert shown.page.hosts() == {f"127.0.0.1:{shown.server.get_port()}"}
