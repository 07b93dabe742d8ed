"""Windows of expected contacts, in which the levels are higher."""

from typing import Any

import pytest

from contactsense import Contact
from tests.service.reactions.engines import HIGH, engine, rule, run
from tests.service.reactions.estimates import contact, estimate

STEP = 0.002
EXPECTED = {"name": "insert", "links": ["forearm"], "force": 80.0, "timeout": 1.0, "value": 3}


@pytest.mark.parametrize(
    ("more", "touched", "fires"),
    [
        ({}, contact(newtons=60.0), False),
        ({}, contact(newtons=85.0), True),
        ({}, contact("upper_arm", 60.0), True),
        ({"force": 30.0}, contact(newtons=40.0), False),
        ({"point": [0.5, 0.0, 0.42]}, contact(newtons=60.0), False),
        ({"point": [0.5, 0.1, 0.4]}, contact(newtons=60.0), True),
    ],
)
def test_an_expected_contact_has_a_higher_level(more: dict[str, Any], touched: Contact, fires: bool) -> None:
    machine = engine(rule(links=["any"]), expected=[{**EXPECTED, **more}])
    run(machine, estimate(0.0))
    assert machine.announce("insert")
    assert bool(run(machine, estimate(0.5, touched))) == fires


def test_an_active_level_keeps_its_hysteresis_in_a_window() -> None:
    level = {"force": 20.0, "release": 0.8}
    window = {"name": "w", "links": ["forearm"], "force": 60.0}
    machine = engine(rule(collision=None, contact=level), expected=[window])
    assert machine.announce("w")
    forces = [65.0, 55.0, 65.0, 52.0, 44.0]  # begins above 60 N, ends below 48 N
    found = run(machine, *(estimate(i * STEP, contact(newtons=newtons)) for i, newtons in enumerate(forces)))
    assert [kind for _, _, kind in found] == ["begin", "end"]
    assert found[-1][0] == 4 * STEP


@pytest.mark.parametrize(
    "first", [{"links": ["wrist_3"]}, {"links": ["forearm"], "point": [0.0, 0.0, 1.0]}], ids=["link", "place"]
)
def test_a_window_for_another_place_hides_no_later_one(first: dict[str, Any]) -> None:
    machine = engine(rule(), expected=[{"name": "elsewhere", "force": 80.0, **first}, EXPECTED])
    for name in ("elsewhere", "insert"):
        assert machine.announce(name)
    assert run(machine, estimate(0.5, HIGH)) == []


def test_only_a_window_that_is_open_closes() -> None:
    windows = [{"name": name, "links": ["forearm"], "force": 60.0} for name in ("a", "b")]
    machine = engine(rule(), expected=windows)
    machine.announce("a")
    assert machine.withdraw("b") == ()
    assert machine.withdraw() == ("a",)


def test_windows_close() -> None:
    machine = engine(rule(), expected=[EXPECTED])
    assert not machine.announce("remove")
    assert machine.by_value(3) == "insert"
    assert machine.by_value(4) is None
    run(machine, estimate(0.0))
    machine.announce("insert")
    assert run(machine, estimate(0.9, HIGH)) == []
    assert machine.take_lapsed() == []
    assert run(machine, estimate(1.1, HIGH)) == [(1.1, "collision", "begin")]  # timed out
    assert machine.take_lapsed() == ["insert: closed after 1 s, its timeout"]
    assert machine.take_lapsed() == []
    machine.acknowledge()
    machine.announce("insert")
    assert machine.windows == ("insert",)
    machine.withdraw("insert")
    assert run(machine, estimate(1.2, HIGH)) == [(1.2, "collision", "begin")]


def test_a_window_that_is_announced_before_the_first_sample_opens_with_it() -> None:
    machine = engine(
        rule(), expected=[{"name": "insert", "links": ["forearm"], "force": 100.0, "timeout": 1.0}]
    )
    assert machine.announce("insert")
    assert not run(machine, estimate(500.0), estimate(500.9, HIGH))
    assert machine.windows == ("insert",)
    assert run(machine, estimate(501.1, HIGH))
    assert machine.windows == ()


def test_a_clock_set_back_closes_windows_and_says_so() -> None:
    """How long they have been open is not known."""
    machine = engine(rule(), expected=[EXPECTED])
    run(machine, estimate(10.0))
    machine.announce("insert")
    assert run(machine, estimate(10.0, HIGH)) == []  # the same time twice is none
    assert machine.windows == ("insert",)
    assert run(machine, estimate(9.9, HIGH)) == [(9.9, "collision", "begin")]
    assert machine.windows == ()
    assert machine.take_lapsed() == ["insert: closed, as the clock was set back"]
