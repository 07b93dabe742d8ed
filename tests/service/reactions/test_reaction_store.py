"""Latched collisions and a lowered slider in the journal's file, and what the service makes of them."""

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.events.journal import Journal, JournalSettings
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.reaction_store import ReactionStore
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions
from tests.service.loopback import until

RULES = ReactionRules.model_validate(
    {
        "actions": {"tell": {"type": "registers"}},
        "rules": [{"name": "arm", "links": ["any"], "collision": {"force": 20.0, "actions": ["tell"]}}],
    }
)

SLOW = ReactionRules.model_validate(
    {
        "actions": {"slow": {"type": "speed_slider", "fraction": 0.1, "restore": 1.0}},
        "rules": [{"name": "arm", "links": ["any"], "contact": {"force": 20.0, "actions": ["slow"]}}],
    }
)


def latch(rule: str = "arm") -> dict[str, Any]:
    decision = Decision(rule, "collision", "begin", ("tell",), 1.0, 0.97, link="forearm", force=30.0)
    return json.loads(json.dumps(decision.as_dict()))


def report(*active: dict[str, Any], restored: bool = True) -> dict[str, Any]:
    return {
        "started": False, "answer": None, "restored": restored, "active": list(active), "expected": [],
        "actions": {}, "lowered": None,
    }  # fmt: skip


def test_what_is_saved_last_is_found_by_the_next_service(tmp_path: Path) -> None:
    settings = JournalSettings(path=tmp_path / "events.db")
    with Journal(settings) as journal:
        store = ReactionStore(journal)
        store.save([latch("a")])
        store.save([latch("b"), latch("c")])
        store.close()
    with Journal(settings) as journal:
        store = ReactionStore(journal)
        assert [found["rule"] for found in store.load()] == ["b", "c"]
        store.save([])
        store.close()
        assert store.load() == []


@pytest.mark.parametrize(
    ("table", "values", "told"),
    [
        ("latches", ("arm", '{"rule": "a'), "latched collision of rule arm: Invalid JSON"),
        ("latches", ("arm", b"\xff\xfe"), "latched collision of rule arm: "),
        ("latches", ("arm", '{"rule": "arm"}'), "latched collision of rule arm: Field required"),
        ("lowered", ("slow",), "lowered speed slider: 'slow'"),
    ],
)
def test_what_is_damaged_is_told_before_the_service_starts(
    tmp_path: Path, table: str, values: tuple[object, ...], told: str
) -> None:
    """Without it nobody knows whether a collision is latched. It ended in a traceback."""
    settings = JournalSettings(path=tmp_path / "events.db")
    with Journal(settings) as journal:
        journal.database.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(values))})", values)
    with pytest.raises(SettingsError, match=rf"events\.db: the journal cannot be read: {told}"):
        create_app(Settings.checked({"events": settings.model_dump()}))


def test_a_field_of_a_later_version_is_left_out(tmp_path: Path) -> None:
    """As after a return to an earlier one; the pipeline's process, which gets it, would end at once."""
    with Journal(JournalSettings(path=tmp_path / "events.db")) as journal:
        store = ReactionStore(journal)
        store.save([{**latch(), "mood": "bad"}])
        store.close()
        assert store.load() == [latch()]


def test_it_is_in_the_file_at_once(tmp_path: Path) -> None:
    path = tmp_path / "events.db"
    with Journal(JournalSettings(path=path)) as journal:
        store = ReactionStore(journal)
        store.save([latch()])
        store.close()
        with sqlite3.connect(path) as other:  # as after a kill: nothing has been closed in order
            assert other.execute("SELECT rule FROM latches").fetchall() == [("arm",)]
        other.close()


def test_what_a_full_disk_does_not_take_is_written_when_it_has_space(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill would lose the collision that is latched now, and bring an older one back."""
    monkeypatch.setattr("contactsense.service.reactions.reaction_store._AGAIN", 0.02)
    with Journal(JournalSettings(path=tmp_path / "events.db")) as journal:
        store = ReactionStore(journal)
        store.save([latch("old")])
        assert until(lambda: store.load() == [latch("old")])
        with journal.lock:
            journal.database.execute("PRAGMA query_only = ON")  # refuses every write, as a full disk
        store.save([latch("lost")])
        store.save_lowered(0.1)
        assert until(lambda: "cannot be written" in caplog.text)
        store.save([latch("new")])
        assert store.load() == [latch("old")]
        with journal.lock:
            journal.database.execute("PRAGMA query_only = OFF")
        assert until(lambda: store.load() == [latch("new")])
        assert until(lambda: store.load_lowered() == 0.1)
        store.close()
    assert caplog.text.count("cannot be written") == 1


def test_the_end_does_not_wait_for_a_full_disk(tmp_path: Path) -> None:
    with Journal(JournalSettings(path=tmp_path / "events.db")) as journal:
        store = ReactionStore(journal)
        with journal.lock:
            journal.database.execute("PRAGMA query_only = ON")
        store.save([latch()])
        store.close()
        assert store.load() == []


def test_the_next_service_knows_that_the_slider_is_lowered(tmp_path: Path) -> None:
    """Else the slider would stay low."""
    settings = JournalSettings(path=tmp_path / "events.db")
    sent: list[dict[str, Any]] = []
    for lowered, expected in ((0.1, None), (0.3, 0.1), (None, 0.3), (None, None)):
        with Journal(settings) as journal:
            store = ReactionStore(journal)
            reactions = Reactions(SLOW, "192.0.2.1", lambda command: sent.append(command) is None)
            reactions.on_lowered = store.save_lowered
            reactions.restore(store.load(), store.load_lowered())
            assert reactions.health().lowered == expected
            reactions.handle_report({**report(), "started": True})
            assert sent[-1]["lowered"] == expected
            reactions.handle_report({**report(restored=False), "lowered": None})
            assert reactions.health().lowered == expected  # the process has not been told yet
            reactions.handle_report({**report(), "lowered": lowered})
            assert reactions.health().lowered == lowered
            store.close()


def test_a_slider_that_no_action_raises_any_more_is_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with Journal(JournalSettings(path=tmp_path / "events.db")) as journal:
        store = ReactionStore(journal)
        store.save_lowered(0.1)
        store.close()
        assert store.load_lowered() == 0.1
        again = ReactionStore(journal)
        reactions = Reactions(RULES, "192.0.2.1", lambda command: True)
        reactions.on_lowered = again.save_lowered
        reactions.restore([], again.load_lowered())
        again.close()
        assert again.load_lowered() is None
    assert "the speed slider at 10 %: no action raises it any more" in caplog.text


@pytest.mark.parametrize("rules", [RULES, None], ids=["no slider", "no rules"])
def test_a_reload_that_no_longer_raises_the_slider_tells_it_once_and_forgets_it(
    rules: ReactionRules | None, caplog: pytest.LogCaptureFixture
) -> None:
    """The listener of the new rules knows nothing of the slider, and without rules there is none."""
    reactions = Reactions(SLOW, "192.0.2.1", lambda command: True)
    saved: list[float | None] = []
    reactions.on_lowered = saved.append
    reactions.handle_report({**report(), "lowered": 0.1})
    reactions.replace(SLOW)
    assert "slider" not in caplog.text
    assert reactions.health().lowered == 0.1
    reactions.replace(rules)
    reactions.handle_report({**report(), "lowered": 0.1})  # by the process that is being replaced
    assert saved == [0.1, None]
    assert caplog.text.count("the speed slider is at 10 %: no action raises it any more") == 1


@pytest.mark.parametrize(
    ("restore", "after"),
    [
        (1.0, "raised once no force acts, unless somebody has moved it"),
        (None, "as its action has no restore"),
    ],
)
def test_what_becomes_of_the_slider_is_told_at_the_start(
    restore: float | None, after: str, caplog: pytest.LogCaptureFixture
) -> None:
    slow = {"type": "speed_slider", "fraction": 0.1, "restore": restore}
    rules = ReactionRules.model_validate({**SLOW.model_dump(by_alias=True), "actions": {"slow": slow}})
    Reactions(rules, "192.0.2.1", lambda command: True).restore([], 0.1)
    assert "the service ended with the speed slider at 10 %: it " in caplog.text
    assert after in caplog.text


def test_saved_when_it_changes_and_sent_to_each_new_process() -> None:
    sent: list[dict[str, Any]] = []
    saved: list[list[dict[str, Any]]] = []
    reactions = Reactions(RULES, "192.0.2.1", lambda command: sent.append(command) is None)
    reactions.on_latched = saved.append
    reactions.restore([latch()])
    assert [found.link for found in reactions.latches] == ["forearm"]
    reactions.handle_report({**report(), "started": True})
    assert sent == [{"type": "restore", "decisions": [latch()], "lowered": None}]
    reactions.handle_report(report(restored=False))  # the process does not know it yet
    assert len(reactions.latches) == 1
    assert not saved
    reactions.handle_report(report(latch()))
    assert not saved
    reactions.handle_report(report(latch(), {**latch(), "level": "contact"}))
    assert not saved
    reactions.handle_report(report())
    assert saved == [[]]
    assert not reactions.latches


def test_other_rules_leave_the_latches(tmp_path: Path) -> None:
    reactions = Reactions(RULES, "192.0.2.1", lambda command: True)
    reactions.handle_report(report(latch()))
    reactions.replace(RULES.model_copy(update={"expected": ()}))
    assert len(reactions.latches) == 1
