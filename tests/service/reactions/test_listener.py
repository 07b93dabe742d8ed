"""Reactions in the pipeline's process, against the mock controller."""

import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.service.reactions.rules import ReactionRules
from tests.service.loopback import rtde_server, until
from tests.service.reactions.estimates import SCENE, contact, estimate, sample
from tests.service.reactions.listener_play import RULES, Play


@pytest.fixture
def play() -> Iterator[Play]:
    with rtde_server() as server:
        made = Play(server)
        try:
            made.until(lambda: made.code() == 0)
            yield made
        finally:
            made.listener.close()


def test_a_contact_a_collision_and_an_acknowledgement(play: Play) -> None:
    play.step(estimate(0.0, contact(newtons=20.0)))
    play.until(lambda: play.code() == 41)
    # Each recipe of inputs is a packet of its own.
    play.until(lambda: play.inputs.get("speed_slider_fraction") == (0.1,))
    play.until(lambda: play.inputs.get("input_bit_register_65") == (True,))
    assert play.inputs["input_bit_register_66"] == (False,)
    play.step(estimate(0.1, contact(newtons=60.0)))
    play.until(lambda: play.code() == 42)
    play.until(lambda: play.inputs["input_bit_register_66"] == (True,))
    assert play.inputs["input_double_register_47"][0] == pytest.approx(60.0)
    play.step(estimate(0.2))
    play.until(lambda: play.inputs["speed_slider_fraction"] == (1.0,))
    assert play.code() == 42  # latched
    slider = [event for event in play.events("action") if event["action"] == "slow"]
    assert [event["reason"] for event in slider] == ["done: set to 10 %", "done: set to 100 %"]
    assert [event["t"] for event in slider] == [0.0, 0.2]
    by_rule = {(event["action"], event["rule"], event["link"]) for event in play.events("action")}
    assert by_rule == {("slow", "arm", "forearm"), ("tell", "arm", "forearm")}
    (collision,) = play.events("collision")
    assert (collision["rule"], collision["link"], collision["contact"]) == ("arm", "forearm", 1)
    play.listener.command({"type": "acknowledge", "rule": None, "by": "a test", "id": "7"})
    play.until(lambda: play.code() == 0)
    assert [event["reason"] for event in play.events("acknowledged")] == ["by a test"]
    assert len(play.events("collision")) == 1
    assert any(r.get("answer") == "7" and not r["active"] for r in play.reports)


def test_what_the_registers_show_of_a_latched_collision(play: Play) -> None:
    """The present force while the contact lasts, then the one with which the level began; not the peak."""

    def shows(newtons: float) -> None:
        play.until(lambda: play.inputs.get("input_double_register_47") == (pytest.approx(newtons),))
        assert play.code() == 42

    play.step(estimate(0.0, contact(newtons=60.0)))
    play.until(lambda: play.code() == 42)
    for n, newtons in enumerate((90.0, 30.0, 8.0)):  # the contact level ends below 12 N
        play.step(estimate(0.1 + 0.1 * n, contact(newtons=newtons)))
        shows(newtons)
    play.step(estimate(0.4, status="degraded"))
    shows(8.0)
    play.step(estimate(0.5))
    shows(60.0)
    # A further contact, on another link of the rule: its contact level begins, the collision is latched.
    begun = len(play.events("action"))
    play.step(estimate(0.6, contact("upper_arm", newtons=99.0, id=2)))
    shows(60.0)
    assert len(play.events("collision")) == 1
    assert {event["action"] for event in play.events("action")[begun:]} == {"tell", "slow"}
    play.listener.acknowledge(None, "a test")
    play.until(lambda: play.code() == 31)  # its contact level


def test_the_arm_stays_slow_until_the_last_level_ends() -> None:
    level = {"force": 15.0, "actions": ["slow"]}
    upper = {"name": "upper", "links": ["upper_arm"], "contact": level}
    lower = {"name": "lower", "links": ["forearm"], "contact": level, "collision": {**level, "force": 50.0}}
    with rtde_server() as server:
        play = Play(server, {"actions": RULES["actions"], "rules": [lower, upper]})
        try:
            slider = lambda: play.inputs.get("speed_slider_fraction")  # noqa: E731
            play.until(lambda: play.listener._inputs is not None and play.listener._inputs.ready)
            play.step(estimate(0.0, contact(newtons=60.0), contact("upper_arm", newtons=20.0)))
            play.until(lambda: slider() == (0.1,))
            written: list[Any] = []
            write = RtdeInputs.write

            def note(inputs: RtdeInputs, name: str, values: Any) -> bool:
                written.append(values)
                return write(inputs, name, values)

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(RtdeInputs, "write", note)
                play.step(estimate(0.1, contact("upper_arm", newtons=20.0)))
                play.step(estimate(0.2))
                assert (1, 1.0) not in written
                # Only the latch is left.
                play.listener.acknowledge(None, "a test")
                assert (1, 1.0) in written
            play.until(lambda: slider() == (1.0,))
        finally:
            play.listener.close()


def test_the_robot_program_acknowledges_by_a_bit(play: Play) -> None:
    play.server.controller.set_output("output_bit_register_70", (False,))
    play.step(estimate(0.0, contact(newtons=60.0)))
    play.until(lambda: play.code() == 42)
    play.step(estimate(0.1))
    play.server.controller.set_output("output_bit_register_70", (True,))
    play.until(lambda: play.code() == 0)
    assert "the robot program" in play.events("acknowledged")[0]["reason"]
    # Only the way up acknowledges.
    play.step(estimate(0.2, contact(newtons=60.0)))
    play.until(lambda: play.code() == 42)
    play.server.controller.set_output("output_bit_register_70", (False,))
    play.until(lambda: play.listener._signals._last["output_bit_register_70"] == 0)
    assert play.code() == 42
    assert len(play.events("acknowledged")) == 1


def test_the_robot_program_announces_a_contact(play: Play) -> None:
    play.step(estimate(0.0))
    play.until(lambda: "output_int_register_20" in play.listener._signals._last)
    play.server.controller.set_output("output_int_register_20", (3,))
    play.until(lambda: play.state()["expected"] == ["insert"])
    play.step(estimate(0.1, contact(newtons=60.0)))
    assert not play.events("collision")
    play.server.controller.set_output("output_int_register_20", (0,))
    play.until(lambda: play.state()["expected"] == [])
    play.step(estimate(0.2, contact(newtons=60.0)))
    assert play.events("collision")


def test_a_window_that_closes_of_itself_is_told(play: Play) -> None:
    """Else the journal would not say why a contact that was expected made a collision."""
    for back in (False, True):
        play.step(estimate(0.0))
        play.listener.announce("insert")
        play.step(estimate(0.1, contact(newtons=60.0)))
        play.step(estimate(-1.0) if back else estimate(20.0, contact(newtons=60.0)))
    told = [r["event"] for r in play.reports if r["type"] == "event" and r["event"]["kind"] != "action"]
    assert [(event["kind"], event["reason"]) for event in told] == [
        ("expected", "insert: the window is open"),
        ("expected", "insert: closed after 10 s, its timeout"),
        ("collision", ""),
        ("expected", "insert: the window is open"),
        ("expected", "insert: closed, as the clock was set back"),
    ]


def test_the_heartbeat_goes_on_without_samples(play: Play) -> None:
    seen: set[bool] = set()

    def beats() -> bool:
        seen.add(bool(play.inputs["input_bit_register_64"][0]))
        return len(seen) == 2

    play.until(beats)
    play.step(estimate(0.0))
    play.until(lambda: play.inputs["input_bit_register_67"] == (False,))
    last = time.monotonic()
    play.until(lambda: play.inputs["input_bit_register_67"] == (True,))  # no estimate: degraded
    assert time.monotonic() - last < 2.0


def test_nothing_is_written_before_the_latches_are_known() -> None:
    with rtde_server() as server:
        made = Play(server, told=False)
        begin = {
            "rule": "arm", "level": "collision", "kind": "begin", "actions": ["tell"], "t": 0.0,
            "probability": 1.0, "contact": 1, "link": "forearm", "link_index": 3, "point": [0, 0, 0],
            "point_base": [0, 0, 0], "force_base": [0, 0, 1], "force": 1.0,
        }  # fmt: skip
        codes: set[int] = set()
        try:
            for _ in range(100):
                made.listener.tick(time.monotonic())
                codes.add(made.code())
                time.sleep(0.002)
            assert codes == {-1}
            made.listener.command({"type": "restore", "decisions": [begin]})
            made.until(lambda: made.code() != -1)
            assert made.code() == 42
        finally:
            made.listener.close()


def test_in_use_names_the_variable_and_what_else_to_take() -> None:
    with rtde_server() as server:
        first = RtdeInputs("127.0.0.1", server.port, {"a": ["input_int_register_47"]})
        deadline = time.monotonic() + 60.0
        while not first.ready:
            assert time.monotonic() < deadline
            first.poll(time.monotonic())
            time.sleep(0.002)
        made = Play(server)
        try:
            made.until(lambda: made.events("action"))
            (event,) = made.events("action")
            assert event["action"] == "tell"
            assert event["t"] is None  # no sample has arrived: 0.0 would be a time
            assert "IN_USE: another client writes input_int_register_47" in event["reason"]
            assert "take others in the rules' file: int and double 24 to 47" in event["reason"]
            made.step(estimate(0.0, contact(newtons=20.0)))
            made.until(lambda: made.inputs.get("speed_slider_fraction") == (0.1,))  # the other recipe works
            first.close()
            made.until(lambda: made.code() == 41)  # taken as soon as it is free
            made.until(lambda: made.state()["actions"]["tell"]["state"] == "ok")
        finally:
            made.listener.close()
            first.close()


def test_registers_are_written_with_each_sample_of_a_contact(play: Play) -> None:
    """Not only with the heartbeat, which `tick` sends."""
    for t, newtons in ((0.0, 20.0), (0.002, 30.0)):
        play.step(estimate(t, contact(newtons=newtons)))
    assert until(lambda: play.inputs.get("input_double_register_47") == (30.0,))


def test_rules_without_registers_decide_as_well() -> None:
    rule = {"name": "arm", "links": ["any"], "collision": {"force": 50.0}}
    rules = ReactionRules.model_validate({"rules": [rule]})
    listener = ReactionListener(rules, SCENE, None)
    try:
        for t in (0.0, 0.002):
            listener.receive(sample(t), estimate(t, contact(newtons=100.0)))
        listener.tick(time.monotonic())
        kinds = [r["event"]["kind"] for r in listener.take_reports() if r["type"] == "event"]
        assert kinds == ["collision"]
    finally:
        listener.close()


def test_what_becomes_of_a_command_is_told_also_without_registers_and_slider() -> None:
    """It does not hang because the latest tick, here none, was long ago."""
    rules = {
        "actions": {"run": {"type": "command", "command": ["true"], "timeout": 60.0}},
        "inputs": RULES["inputs"],
        "rules": [{"name": "arm", "links": ["any"], "collision": {"force": 50.0, "actions": ["run"]}}],
    }
    with rtde_server() as server:
        made = Play(server, rules)
        try:
            made.step(estimate(0.0, contact(newtons=60.0)))
            made.until(lambda: made.events("action"))
            (event,) = made.events("action")
            assert (event["action"], event["reason"]) == ("run", "done: exit status 0")
            assert (event["rule"], event["link"]) == ("arm", "forearm")
        finally:
            made.listener.close()


@pytest.fixture
def unconnected() -> Iterator[ReactionListener]:
    """A listener whose controller does not answer."""
    with socket.create_server(("127.0.0.1", 0)) as mute:
        rules = ReactionRules.model_validate({**RULES, "robot": {"rtde_port": mute.getsockname()[1]}})
        listener = ReactionListener(rules, SCENE, "127.0.0.1")
        yield listener
        listener.close()


def test_a_service_that_does_not_tell_what_was_latched_is_waited_for_for_a_second(
    unconnected: ReactionListener,
) -> None:
    registers = unconnected._registers
    assert registers is not None
    for now, known in ((100.0, False), (100.9, False), (101.1, True)):
        unconnected.tick(now)
        assert registers.latches_known == known


def test_without_estimates_the_degraded_bit_is_set(unconnected: ReactionListener) -> None:
    seen = []
    for now, estimated in ((100.0, False), (100.01, True), (100.1, False), (100.2, False), (100.21, True)):
        if estimated:
            unconnected.receive(sample(now), estimate(now))
        unconnected.tick(now)
        seen.append(unconnected._degraded)
    assert seen == [True, False, False, True, False]


def test_the_state_is_reported_at_the_start_and_four_times_a_second(unconnected: ReactionListener) -> None:
    """The service answers the first report with what it knows of the process before."""
    (first,) = unconnected.take_reports()
    assert first["started"]
    told = []
    for now in (100.0, 100.24, 100.26, 100.49, 100.52):
        unconnected.tick(now)
        told.append([report["started"] for report in unconnected.take_reports()])
    assert told == [[False], [], [False], [], [False]]


def test_the_heartbeat_is_written_when_it_is_due(
    unconnected: ReactionListener, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[float] = []
    assert unconnected._registers is not None
    monkeypatch.setattr(unconnected._registers, "write", lambda *_: written.append(now))
    monkeypatch.setattr(unconnected._registers, "is_due", lambda now: now == 100.01)
    for now in (100.0, 100.01, 100.02):
        unconnected.tick(now)
    assert written == [100.01]


def test_without_registers_and_slider_time_passes_as_well() -> None:
    """An error would end all that is due at this moment, such as reports."""
    rules = ReactionRules.model_validate(
        {"rules": [{"name": "r", "links": ["any"], "contact": {"force": 9.0}}]}
    )
    listener = ReactionListener(rules, SCENE, None)
    listener.take_reports()
    for now in (100.0, 102.0):
        listener.tick(now)
        assert [report["type"] for report in listener.take_reports()] == ["reactions"]
    listener.close()


def test_a_sample_that_changes_nothing_writes_and_reports_nothing(
    unconnected: ReactionListener, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a level is active, the registers show the force of each sample."""
    written: list[float] = []
    monkeypatch.setattr(unconnected._registers, "write", lambda t, *_: written.append(t))
    for t, force in ((0.0, ()), (0.1, ()), (0.2, (contact(newtons=20.0),)), (0.3, (contact(newtons=20.0),))):
        unconnected.take_reports()
        unconnected.receive(sample(t), estimate(t, *force))
        assert bool(unconnected.take_reports()) == (t == 0.2), t
    assert written == [0.2, 0.3]


def test_windows_that_open_and_close_are_told_and_no_others(unconnected: ReactionListener) -> None:
    for kind, name in (
        ("announce", "insert"), ("announce", "remove"), ("withdraw", "remove"), ("withdraw", "insert"),
        ("withdraw", "insert"), ("announce", "insert"), ("withdraw", None), ("withdraw", None),
    ):  # fmt: skip
        unconnected.command({"type": kind, "name": name})
    events = [report["event"] for report in unconnected.take_reports() if report["type"] == "event"]
    opened = "insert: the window is open"
    assert [event["reason"] for event in events] == [opened, "insert: closed", opened, "all: closed"]
    assert {event["kind"] for event in events} == {"expected"}


def test_registers_that_are_not_written_are_not_told_to_be(unconnected: ReactionListener) -> None:
    unconnected.command({"type": "restore", "decisions": []})
    unconnected.receive(sample(0.0), estimate(0.0, contact(newtons=20.0)))
    events = [report["event"] for report in unconnected.take_reports() if report["type"] == "event"]
    assert ("tell", "failed: not connected") in [(e["action"], e["reason"]) for e in events]


def test_a_latch_is_reported_at_once_and_restored_by_the_next_process() -> None:
    with rtde_server() as server:
        first = Play(server)
        try:
            first.until(lambda: first.code() == 0)
            first.listener.take_reports()
            first.step(estimate(0.0, contact(newtons=60.0)))
            (report,) = [r for r in first.reports if r["type"] == "reactions" and r["active"]]
            assert report["restored"]
        finally:
            first.listener.close()
        latched = [d for d in report["active"] if d["level"] == "collision"]
        second = Play(server)
        try:
            assert not second.listener.take_reports()[0]["restored"]
            second.listener.command({"type": "restore", "decisions": latched})
            second.until(lambda: second.code() == 42)
            assert second.inputs["input_bit_register_66"] == (True,)
            assert not second.events("collision")  # it is told once
        finally:
            second.listener.close()


def test_a_latch_whose_rule_is_gone_is_told_and_dropped() -> None:
    with rtde_server() as server:
        made = Play(server)
        begin = {
            "rule": "leg", "level": "collision", "kind": "begin", "actions": ["tell"], "t": 0.0,
            "probability": 1.0, "contact": 1, "link": "forearm", "link_index": 3, "point": [0, 0, 0],
            "point_base": [0, 0, 0], "force_base": [0, 0, 1], "force": 1.0,
        }  # fmt: skip
        try:
            made.listener.command({"type": "restore", "decisions": [begin]})
            made.until(lambda: made.code() == 0)
            (event,) = made.events("acknowledged")
            assert "no such level any more" in event["reason"]
        finally:
            made.listener.close()
