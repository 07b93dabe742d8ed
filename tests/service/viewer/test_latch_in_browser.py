"""Latched collisions of a real service in a real browser: the button acknowledges them, if it may."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.reaction_store import ReactionStore
from contactsense.service.viewer.live_source import LiveSource
from contactsense.service.viewer.service_calls import ServiceCalls
from tests.browser import require_browser
from tests.service import fakes, http
from tests.service.loopback import until
from tests.service.serving import serving
from tests.service.viewer.shown import PATIENCE, Shown, showing

pytestmark = pytest.mark.long
TOKEN = "a token of more than sixteen characters"
RULES = {
    "actions": {"note": {"type": "command", "command": ["true"]}},
    "rules": [{"name": "arm", "links": ["any"], "collision": {"force": 20.0, "actions": ["note"]}}],
}
COLLISION = Decision("arm", "collision", "begin", ("note",), 4.0, 0.99, 1, "forearm", 3, force=31.4)
TOLD = "arm: 31 N on forearm"


@dataclass
class Cell:
    """A service with a latched collision, and a viewer of it."""

    shown: Shown
    calls: ServiceCalls

    def latched(self) -> list[object]:
        headers = {"Authorization": f"Bearer {TOKEN}"}
        found: list[object] = http.get(f"{self.calls.url}/v1/reactions", headers=headers).json()["latched"]
        return found


@pytest.fixture
def cell(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Cell]:
    """The viewer shows the button or not, as the test asks."""
    require_browser()
    journal = Journal(JournalSettings(path=tmp_path / "events.db"))
    store = ReactionStore(journal)
    store.save([COLLISION.as_dict()])
    store.close()
    journal.close()
    (tmp_path / "rules.yaml").write_text(yaml.safe_dump(RULES))
    settings = Settings.checked(
        {
            "token": TOKEN, "events": {"path": tmp_path / "events.db"},
            "reactions": {"file": tmp_path / "rules.yaml"},
        }
    )  # fmt: skip
    with serving(create_app(settings, fakes.Untouched)) as address:
        calls = ServiceCalls(f"http://{address}", TOKEN)
        source = LiveSource(calls)
        try:
            assert until(lambda: source.note().startswith("ok"), PATIENCE)
            acknowledge = source.acknowledge if request.param else None
            with showing(source.scene, tmp_path / "profile", acknowledge) as shown:
                shown.latches = lambda: source.latches
                shown.page.wait_for(TOLD)
                yield Cell(shown, calls)
                assert shown.page.errors() == []
        finally:
            source.close()


@pytest.mark.parametrize("cell", [True], indirect=True)
def test_the_button_acknowledges_where_the_token_allows_it(cell: Cell) -> None:
    cell.calls.headers["Authorization"] = "Bearer wrong"
    cell.shown.page.press("Acknowledge")
    cell.shown.page.wait_for("401 the token is wrong; --token-file names the file with its token")
    assert TOLD in cell.shown.page.text()
    assert len(cell.latched()) == 1

    cell.calls.headers["Authorization"] = f"Bearer {TOKEN}"
    cell.shown.page.press("Acknowledge")
    assert until(lambda: TOLD not in cell.shown.page.text(), PATIENCE)
    assert cell.latched() == []


@pytest.mark.parametrize("cell", [False], indirect=True)
def test_without_leave_there_is_no_button(cell: Cell) -> None:
    buttons = cell.shown.page.evaluate("[...document.querySelectorAll('button')].map(b => b.innerText)")
    assert "Back to the scene" in [each.strip() for each in buttons]
    assert "Acknowledge" not in [each.strip() for each in buttons]
