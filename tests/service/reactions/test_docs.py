"""What docs/reactions.md shows can be used as it stands there."""

import re
from pathlib import Path
from typing import get_args

import yaml

from contactsense.service.reactions.actions import Action
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.webhook_delivery import DELAYS, JITTER, MOST
from tests.service.reactions.estimates import SCENE

PAGE = (Path(__file__).parents[3] / "docs" / "reactions.md").read_text(encoding="utf-8")


def test_the_file_can_be_used() -> None:
    found = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    rules = ReactionRules.model_validate(yaml.safe_load(found[1]))
    rules.check(SCENE)
    assert len(rules.rules) == 2


def test_every_action_is_described() -> None:
    union = get_args(Action)[0]
    for action in get_args(union):
        (kind,) = get_args(action.model_fields["type"].annotation)
        assert f"| `{kind}` |" in PAGE


def test_the_page_says_when_deliveries_are_tried_again() -> None:
    at_once, *later = DELAYS
    assert at_once == 0.0
    units = {1.0: "s", 60.0: "min", 3600.0: "h"}
    words = []
    for delay in later:
        unit = max(size for size in units if size <= delay)
        words.append(f"{delay / unit:g} {units[unit]}")
    assert words[-1] == words[-2]
    times = f"It is tried at once, then after {', '.join(words[:-2])} and twice {words[-1]}"
    assert f"{times}, each varied by up to {JITTER:.0%}".replace("%", " %") in PAGE
    assert f"The newest {MOST} deliveries of each webhook wait" in PAGE
