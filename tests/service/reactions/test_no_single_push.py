"""Measurements that no single push explains, and the rules on any link."""

from typing import Any

import pytest

from contactsense import Estimate
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.rules import ReactionRules
from tests.service.reactions.estimates import SCENE, contact, estimate, sample


def decided(what: Estimate, **more: Any) -> Decision | None:
    """What a rule on any link, at 50 N, decides."""
    rule = {"name": "r", "links": ["any"], "collision": {"force": 50.0}, **more}
    engine = Engine(ReactionRules.model_validate({"rules": [rule]}), SCENE)
    return next(iter(engine.step(sample(0.0), what)), None)


UP, DOWN, ASIDE = ([0, 0, 1], [0, 0, -1], [1, 0, 0])


@pytest.mark.parametrize(
    ("newtons", "direction", "fires"),
    [
        (60.0, None, True),
        (-60.0, None, True),
        (50.0, None, False),  # as likely below
        (40.0, None, False),
        (60.0, {"axis": UP, "half_angle": 0.5}, True),
        (60.0, {"axis": DOWN, "half_angle": 0.5}, False),
        (-60.0, {"axis": DOWN, "half_angle": 0.5}, True),
        (60.0, {"axis": ASIDE, "half_angle": 0.5}, False),
        (60.0, {"axis": ASIDE, "half_angle": 2.0}, True),
        (60.0, {"axis": UP, "half_angle": 0.5, "frame": "link"}, False),  # which link?
    ],
)
def test_its_whole_force_and_direction_count(
    newtons: float, direction: dict[str, Any] | None, fires: bool
) -> None:
    what = estimate(0.0, other=1.0, unexplained=newtons)
    assert (decided(what, direction=direction) is not None) == fires


@pytest.mark.parametrize(("other", "fires"), [(0.3, True), (0.2, False)])
def test_its_probability_is_added_to_that_of_the_contacts(other: float, fires: bool) -> None:
    """Two explanations of the same measurement."""
    found = decided(estimate(0.0, contact(newtons=60.0, probability=0.65), other=other))
    assert (found is not None) == fires
    assert found is None or found.probability == pytest.approx(0.65 + other)


@pytest.mark.parametrize(("other", "link"), [(0.9, ""), (0.1, "forearm")])
def test_a_decision_is_about_the_most_probable_explanation(other: float, link: str) -> None:
    found = decided(estimate(0.0, contact(newtons=60.0, probability=1.0 - other), other=other))
    assert found is not None
    number = SCENE.link_names.index(link) if link else -1
    assert (found.contact, found.link, found.link_index) == (1 if link else 0, link, number)
    assert (found.force_base, found.force) == ((0.0, -60.0, 0.0), 60.0)
