"""The rules at work, against constructed estimates."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsense import Estimate, Sample, Scene, robots
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.primitives import Sphere
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.tool import Tool
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.rules import ReactionRules, RulesError
from tests.service.reactions.engines import HIGH, engine, rule, run
from tests.service.reactions.estimates import SCENE, contact, estimate, sample

STEP = 0.002
LEVEL = 50.0
FORCES = [  # force [N], fires with probability 0.9 at a level of 50 N and a deviation of 1 N
    (45.0, False), (50.0, False), (51.2, False), (51.3, True), (60.0, True)
]  # fmt: skip


@pytest.mark.parametrize(("newtons", "fires"), FORCES)
def test_the_force_must_exceed_the_level_with_the_stated_probability(newtons: float, fires: bool) -> None:
    assert bool(run(engine(rule()), estimate(0.0, contact(newtons=newtons)))) == fires


CASES: list[tuple[str, dict[str, Any], Estimate, float, bool]] = [
    ("another link", {}, estimate(0.0, contact("upper_arm", 60.0)), 0.0, False),
    ("a group", {"links": ["arm"]}, estimate(0.0, contact("upper_arm", 60.0)), 0.0, True),
    ("any link", {"links": ["any"]}, estimate(0.0, contact("wrist_3", 60.0)), 0.0, True),
    ("half probable", {}, estimate(0.0, contact(newtons=60.0, probability=0.5)), 0.0, False),
    (
        "two links, one of them the rule's",
        {},
        estimate(0.0, contact(newtons=60.0, probability=0.5), contact("upper_arm", 60.0, 0.5)),
        0.0,
        False,
    ),
    (
        "two links, both the rule's",
        {"links": ["arm"]},
        estimate(0.0, contact(newtons=60.0, probability=0.5), contact("upper_arm", 60.0, 0.5)),
        0.0,
        True,
    ),
    (
        "several at a time do not add up",
        {"links": ["arm"]},
        estimate(
            0.0,
            contact(newtons=60.0, probability=0.6),
            contact("upper_arm", 60.0, 0.6, id=2),
            status="multiple",
        ),
        0.0,
        False,
    ),
    ("no single push, any link", {"links": ["any"]}, estimate(0.0, other=1.0, unexplained=60.0), 0.0, True),
    ("no single push, some link", {}, estimate(0.0, other=1.0, unexplained=60.0), 0.0, False),
    ("any motion, at rest", {"while": "any"}, estimate(0.0, HIGH), 0.0, True),
    ("any motion, moving", {"while": "any"}, estimate(0.0, HIGH), 0.1, True),
    ("while moving, at rest", {"while": "moving"}, estimate(0.0, HIGH), 0.0, False),
    ("while moving, moving", {"while": "moving"}, estimate(0.0, HIGH), 0.1, True),
    ("at rest, moving", {"while": "rest"}, estimate(0.0, HIGH), 0.1, False),
    (
        "no single push, in a link's frame",
        {"links": ["any"], "direction": {"axis": [0, 0, 1], "half_angle": 3.0, "frame": "link"}},
        estimate(0.0, other=1.0, unexplained=60.0),
        0.0,
        False,
    ),
    (
        "no single push, half probable",
        {"links": ["any"]},
        estimate(0.0, contact(newtons=60.0, probability=0.1), other=0.5),
        0.0,
        False,
    ),
    ("at rest, at rest", {"while": "rest"}, estimate(0.0, HIGH), 0.01, True),
    ("degraded, act", {}, estimate(0.0, HIGH, status="degraded"), 0.0, True),
    ("degraded, hold", {"on_degraded": "hold"}, estimate(0.0, HIGH, status="degraded"), 0.0, False),
    ("degraded, ignore", {"on_degraded": "ignore"}, estimate(0.0, HIGH, status="degraded"), 0.0, False),
    (
        "within the cone",
        {"direction": {"axis": [0, -2, 0], "half_angle": 0.1}},
        estimate(0.0, HIGH),
        0.0,
        True,
    ),
    (
        "outside of the cone",
        {"direction": {"axis": [0, 1, 0], "half_angle": 1.5}},
        estimate(0.0, HIGH),
        0.0,
        False,
    ),
]


@pytest.mark.parametrize(
    ("fields", "given_estimate", "speed", "fires"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_which_contacts_count(
    fields: dict[str, Any], given_estimate: Estimate, speed: float, fires: bool
) -> None:
    machine = engine(rule(**fields), groups={"arm": ["upper_arm", "forearm"]})
    assert bool(run(machine, given_estimate, speed=speed)) == fires


@pytest.mark.parametrize("order", [1, -1])
def test_of_several_contacts_the_largest_counts(order: int) -> None:
    pair = (HIGH, contact("upper_arm", 20.0, id=2))[::order]
    assert run(engine(rule(links=["any"])), estimate(0.0, *pair, status="multiple"))


def test_an_explanation_on_another_link_does_not_end_the_search() -> None:
    other = contact("upper_arm", 60.0, 0.05)
    machine = engine(rule())
    (decision,) = machine.step(sample(0.0), estimate(0.0, other, contact(newtons=60.0, probability=0.95)))
    assert decision.link == "forearm"
    assert decision.probability == pytest.approx(0.95)


def test_no_probability_is_above_one() -> None:
    """Those of explanations that exclude each other add up to 1, but for rounding."""
    pair = contact(newtons=60.0, probability=0.6), contact("upper_arm", 60.0, 0.6)
    for found in (estimate(0.0, *pair), estimate(0.0, *pair[:1], other=0.6, unexplained=60.0)):
        (decision,) = engine(rule(links=["any"])).step(sample(0.0), found)
        assert decision.probability == 1.0


def test_the_decision_says_what_it_is_about() -> None:
    other = contact("upper_arm", 70.0, 0.05)
    machine = engine(rule(links=["any"]))
    (decision,) = machine.step(sample(1.5), estimate(1.5, contact(newtons=60.0, probability=0.95), other))
    assert (decision.rule, decision.link, decision.link_index, decision.contact) == ("r", "forearm", 3, 1)
    assert decision.force == pytest.approx(60.0)
    assert decision.point_base == (0.5, 0.0, 0.4)
    assert decision.probability == pytest.approx(1.0)


def test_a_contact_level_ends_with_hysteresis() -> None:
    machine = engine(rule(collision=None, contact={"force": 50.0, "release": 0.8}))
    steps = [60.0, 49.0, 42.0, 40.0, 49.0, 60.0]
    seen = run(machine, *[estimate(i * STEP, contact(newtons=f)) for i, f in enumerate(steps)])
    assert [(round(t / STEP), kind) for t, _, kind in seen] == [(0, "begin"), (3, "end"), (5, "begin")]


def test_a_collision_latches_until_it_is_acknowledged() -> None:
    machine = engine(rule())
    assert run(machine, estimate(0.0, HIGH)) == [(0.0, "collision", "begin")]
    assert run(machine, estimate(0.1, HIGH), estimate(0.2), estimate(0.3, HIGH)) == []
    assert [(latch.rule, latch.t, latch.link) for latch in machine.latches] == [("r", 0.0, "forearm")]
    (ended,) = machine.acknowledge()
    assert (ended.kind, ended.rule, ended.link, ended.link_index) == ("end", "r", "forearm", 3)
    assert not machine.latches
    assert machine.acknowledge() == ()
    assert run(machine, estimate(0.4, HIGH)) == [(0.4, "collision", "begin")]  # it is still there


def test_one_rule_is_acknowledged_and_the_other_not() -> None:
    machine = engine(rule(), rule(name="s"))
    run(machine, estimate(0.0, HIGH))
    machine.acknowledge("s")
    assert [latch.rule for latch in machine.latches] == ["r"]


def test_a_latch_is_restored() -> None:
    both = rule(contact={"force": 50.0})
    first, second = engine(both), engine(rule(name="other"), both)
    _, begin = first.step(sample(0.0), estimate(0.0, HIGH))
    assert second.restore(begin)
    assert second.latches == first.latches
    assert [(d.rule, d.level) for d in second.active] == [("r", "collision")]
    other, contact_level = second.step(sample(5.0), estimate(5.0, HIGH))
    assert (other.rule, other.level) == ("other", "collision")
    assert (contact_level.rule, contact_level.level) == ("r", "contact")


@pytest.mark.parametrize("now", [rule(name="other"), rule(collision=None, contact={"force": 50.0})])
def test_a_latch_of_a_level_that_the_rules_no_longer_have_is_not_restored(now: dict[str, Any]) -> None:
    (begin,) = engine(rule()).step(sample(0.0), estimate(0.0, HIGH))
    machine = engine(now)
    assert not machine.restore(begin)
    assert machine.active == ()


def test_only_collisions_latch_and_are_acknowledged() -> None:
    machine = engine(rule(contact={"force": 20.0}))
    run(machine, estimate(0.0, HIGH))
    assert [d.level for d in machine.active] == ["contact", "collision"]
    assert len(machine.latches) == 1
    assert [d.level for d in machine.acknowledge()] == ["collision"]
    assert [d.level for d in machine.active] == ["contact"]
    assert run(machine, estimate(0.1)) == [(0.1, "contact", "end")]


def test_rules_of_another_arm_are_refused() -> None:
    with pytest.raises(RulesError, match=r"rules: r: .*elbow_9"):
        engine(rule(links=["elbow_9"]))


def test_a_latch_is_restored_with_the_actions_that_the_rules_have_now() -> None:
    """They, not those of before, are ended by its acknowledgement."""
    actions = {name: {"type": "registers"} for name in ("before",)}
    first = engine(rule(collision={"force": 50.0, "actions": ["before"]}), actions=actions)
    (begin,) = first.step(sample(0.0), estimate(0.0, HIGH))
    second = engine(
        rule(collision={"force": 50.0, "actions": ["now"]}), actions={"now": {"type": "registers"}}
    )
    second.restore(begin)
    assert second.active[0].actions == ("now",)
    assert second.acknowledge()[0].actions == ("now",)


def test_one_joint_that_turns_is_motion() -> None:
    machine = engine(rule(**{"while": "moving"}))
    one = Sample(0.0, np.zeros(6), np.array([0.0, 0.0, 0.0, 0.0, -0.1, 0.0]))
    assert machine.step(one, estimate(0.0, HIGH))


def test_a_duration_begins_anew_after_a_degraded_estimate_that_holds() -> None:
    machine = engine(rule(collision={"force": 50.0, "duration": 0.1}, on_degraded="hold"))
    seen = run(
        machine,
        estimate(0.0, HIGH),
        estimate(0.05, HIGH, status="degraded"),
        estimate(0.1, HIGH),
        estimate(0.19, HIGH),
        estimate(0.2, HIGH),
    )
    assert seen == [(0.2, "collision", "begin")]


@pytest.mark.parametrize("between", [estimate(0.05), estimate(0.05, contact(newtons=20.0))])
def test_a_duration_begins_anew_after_a_sample_without_the_force(between: Estimate) -> None:
    machine = engine(rule(collision={"force": 50.0, "duration": 0.1}), rule(name="s", links=["wrist_3"]))
    seen = run(machine, estimate(0.0, HIGH), between, estimate(0.1, HIGH), estimate(0.2, HIGH))
    assert seen == [(0.2, "collision", "begin")]


def test_blindness_ends_nothing() -> None:
    machine = engine(rule(collision=None, contact={"force": 50.0}))
    run(machine, estimate(0.0, HIGH))
    assert run(machine, estimate(0.1, status="degraded")) == []
    assert run(machine, estimate(0.2)) == [(0.2, "contact", "end")]


@pytest.mark.parametrize(
    ("on_degraded", "seen", "unseen"), [("act", False, False), ("hold", False, False), ("ignore", True, True)]
)
def test_what_a_degraded_estimate_ends(on_degraded: str, seen: bool, unseen: bool) -> None:
    """With the contact that lasts, and without any."""
    for contacts, ends in (((HIGH,), seen), ((), unseen)):
        machine = engine(rule(collision=None, contact={"force": 50.0}, on_degraded=on_degraded))
        run(machine, estimate(0.0, HIGH))
        assert bool(run(machine, estimate(0.1, *contacts, status="degraded"))) == ends


def test_a_clock_set_back_starts_durations_anew() -> None:
    machine = engine(rule(collision={"force": 50.0, "duration": 0.1}))
    assert run(machine, estimate(10.0, HIGH), estimate(0.0, HIGH), estimate(0.05, HIGH)) == []
    assert run(machine, estimate(0.1, HIGH)) == [(0.1, "collision", "begin")]


def test_a_level_that_was_active_when_the_clock_was_set_back_ends_with_the_contact() -> None:
    machine = engine(rule(collision=None, contact={"force": 50.0}))
    run(machine, estimate(10.0, HIGH))
    assert run(machine, estimate(0.0, HIGH), estimate(0.1), estimate(0.2)) == [(0.1, "contact", "end")]


def test_a_decision_is_updated_by_the_explanation_on_its_rules_links() -> None:
    machine = engine(rule())
    (begin,) = machine.step(sample(0.0), estimate(0.0, contact(newtons=60.0)))
    other = contact("upper_arm", newtons=80.0, probability=0.6)
    updated = machine.updated(begin, estimate(0.1, other, contact(newtons=70.0, probability=0.4)))
    assert (updated.link, updated.force) == ("forearm", 70.0)
    assert machine.updated(begin, estimate(0.1, other)) == begin


def test_a_decision_is_updated_by_the_most_probable_explanation_of_its_own_contact() -> None:
    machine = engine(rule(links=["any"]))
    (begin,) = machine.step(sample(0.0), estimate(0.0, contact(newtons=60.0, id=2)))
    less, more, another = (
        contact(newtons=newtons, probability=probability, id=number)
        for newtons, probability, number in ((61.0, 0.2, 2), (62.0, 0.8, 2), (63.0, 0.9, 3))
    )
    assert machine.updated(begin, estimate(0.1, less, more, another, status="multiple")).force == 62.0


@given(st.lists(st.sampled_from([60.0, 20.0, None]), min_size=1, max_size=60), st.integers(0, 10))
def test_the_law_of_duration_and_latch(forces: list[float | None], samples: int) -> None:
    """It fires once, at the first sample that ends a run of `duration` without a break; None: no contact."""
    machine = engine(rule(collision={"force": LEVEL, "duration": samples * STEP}))
    touched = [() if force is None else (contact(newtons=force),) for force in forces]
    fired = run(machine, *[estimate(i * STEP, *contacts) for i, contacts in enumerate(touched)])
    runs, count = [], 0
    for force in forces:
        count = count + 1 if force == 60.0 else 0
        runs.append(count > samples)
    expected = [(runs.index(True) * STEP, "collision", "begin")] if any(runs) else []
    assert fired == expected


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    st.floats(0.05, math.pi),
)
def test_the_law_of_direction(axis: list[float], force: list[float], half_angle: float) -> None:
    a, f = np.array(axis), np.array(force)
    if np.linalg.norm(a) < 0.1 or np.linalg.norm(f) < 0.1:
        return
    angle = math.atan2(float(np.linalg.norm(np.cross(a, f))), float(a @ f))
    if abs(angle - half_angle) < 1e-6:
        return
    push = 100.0 * f / np.linalg.norm(f)
    machine = engine(rule(direction={"axis": axis, "half_angle": half_angle}))
    assert bool(run(machine, estimate(0.0, contact(force_base=push)))) == (angle < half_angle)


@pytest.mark.parametrize("link", [*SCENE.link_names[1:], "ball"])
def test_a_direction_in_the_links_frame_turns_with_it(link: str) -> None:
    """A tool's frame is the flange's."""
    arm, turn = SCENE.robot, rotation_from_rpy((0.0, 0.5, 1.0))
    turned = robots.Robot(arm.name, arm.links, arm.joints, turn, np.zeros(3))
    ball = Sphere(center=(0.0, 0.0, 0.1), radius=0.05)
    scene = Scene(robot=turned, tool=Tool(name="ball", mass=1.0, primitives=(ball,)))
    direction = {"axis": [1, 0, 0], "half_angle": 0.2, "frame": "link"}
    machine = Engine(
        ReactionRules.model_validate({"rules": [rule(links=[link], direction=direction)]}), scene
    )
    q, motion, index = (
        np.array([0.7, -1.3, 1.6, -0.9, 0.8, 0.4]),
        empty_motion(6),
        scene.link_names.index(link),
    )
    forward_kinematics(build_model(turned), q, motion)
    frame = motion.rotation[6] @ turn if link == "ball" else motion.rotation[index]
    for axis, fires in ((1, False), (0, True)):
        hit = estimate(0.0, replace(contact(force_base=60.0 * frame[:, axis]), link=link, link_index=index))
        assert bool(machine.step(sample(0.0, q=q), hit)) == fires
