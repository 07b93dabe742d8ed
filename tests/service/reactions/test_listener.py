"""Reactions in the pipeline's process, against the mock controller."""

import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from contactsense import Estimate
from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.service.reactions.rules import ReactionRules
from tests.service.loopback import rtde_server
from tests.service.reactions.estimates import SCENE, contact, estimate, sample

RULES: dict[str, Any] = {
    "actions": {
        "tell": {"type": "registers"},
        "slow": {"type": "speed_slider", "fraction": 0.1, "restore": 1.0},
    },
    "inputs": {"acknowledge": "output_bit_register_70", "announce": "output_int_register_20"},
    "rules": [
        {
            "name": "arm",
            "links": ["any"],
            "contact": {"force": 15.0, "actions": ["tell", "slow"]},
            "collision": {"force": 50.0, "actions": ["tell"]},
        }
    ],
    "expected": [{"name": "insert", "links": ["forearm"], "force": 100.0, "value": 3}],
}


class Play:
    """A listener whose robot is the mock."""

    def __init__(self, server: Any, rules: dict[str, Any] | None = None) -> None:
        found = ReactionRules.model_validate({**(rules or RULES), "robot": {"rtde_port": server.port}})
        self.server, self.inputs = server, server.controller.inputs
        self.listener = ReactionListener(found, SCENE, "127.0.0.1")
        self.listener.command({"type": "restore", "decisions": []})
        self.reports: list[dict[str, Any]] = []

    def until(self, condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < deadline, (self.inputs, self.reports[-1:])
            self.listener.tick(time.monotonic())
            self.reports += self.listener.take_reports()
            time.sleep(0.002)
        self.reports += self.listener.take_reports()

    def code(self) -> int:
        return int(self.inputs.get("input_int_register_47", (-1,))[0])

    def step(self, what: Estimate) -> None:
        self.listener.receive(sample(what.t), what)
        self.reports += self.listener.take_reports()

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [r["event"] for r in self.reports if r["type"] == "event" and r["event"]["kind"] == kind]

    def slider_is_read(self) -> bool:
        inputs = self.listener._inputs
        return inputs is not None and inputs.ready and "target_speed_fraction" in inputs.values

    def state(self) -> dict[str, Any]:
        return next(r for r in reversed(self.reports) if r["type"] == "reactions")


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
    (collision,) = play.events("collision")
    assert (collision["rule"], collision["link"], collision["contact"]) == ("arm", "forearm", 1)
    play.listener.command({"type": "acknowledge", "rule": None, "by": "a test", "id": "7"})
    play.until(lambda: play.code() == 0)
    assert [event["reason"] for event in play.events("acknowledged")] == ["by a test"]
    assert any(r.get("answer") == "7" and not r["active"] for r in play.reports)


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
    play.until(lambda: play.listener._inputs_before["output_bit_register_70"] == 0)
    assert play.code() == 42
    assert len(play.events("acknowledged")) == 1


def test_the_robot_program_announces_a_contact(play: Play) -> None:
    play.step(estimate(0.0))
    play.until(lambda: "output_int_register_20" in play.listener._inputs_before)
    play.server.controller.set_output("output_int_register_20", (3,))
    play.until(lambda: play.state()["expected"] == ["insert"])
    play.step(estimate(0.1, contact(newtons=60.0)))
    assert not play.events("collision")
    play.server.controller.set_output("output_int_register_20", (0,))
    play.until(lambda: play.state()["expected"] == [])
    play.step(estimate(0.2, contact(newtons=60.0)))
    assert play.events("collision")


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
        made = Play(server)
        begin = {
            "rule": "arm", "level": "collision", "kind": "begin", "actions": ["tell"], "t": 0.0,
            "probability": 1.0, "contact": 1, "link": "forearm", "link_index": 3, "point": [0, 0, 0],
            "point_base": [0, 0, 0], "force_base": [0, 0, 1], "force": 1.0,
        }  # fmt: skip
        made.listener._restored = False
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
        deadline = time.monotonic() + 10.0
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


def test_a_controller_that_is_away_is_told_and_found_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    inputs = RtdeInputs("127.0.0.1", port, {"a": ["input_int_register_47"]})
    deadline = time.monotonic() + 10.0
    while not inputs.error:
        assert time.monotonic() < deadline
        inputs.poll(time.monotonic())
        time.sleep(0.002)
    assert (
        inputs.error == f"RTDE inputs of the robot at 127.0.0.1:{port}: cannot be reached: Connection refused"
    )
    with rtde_server(port=port) as server:
        while not inputs.ready:
            assert time.monotonic() < deadline
            inputs.poll(time.monotonic())
            time.sleep(0.002)
        assert not inputs.error
        assert inputs.write("a", [5])
        while server.controller.inputs.get("input_int_register_47") != (5,):
            assert time.monotonic() < deadline
            time.sleep(0.002)
    inputs.close()


def test_a_mute_controller_blocks_nobody() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        inputs = RtdeInputs("127.0.0.1", mute.getsockname()[1], {"a": ["input_int_register_47"]})
        now = 0.0
        for _ in range(300):
            inputs.poll(now)
            now += 0.01
        assert "no answer in time" in inputs.error
        inputs.close()


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


@pytest.mark.parametrize(
    ("reads", "ended", "after"),
    [(0.1, True, 1.0), (0.1, False, 0.1), (0.3, True, 0.1)],
    ids=["no force acts", "a force acts", "somebody has moved it"],
)
def test_a_slider_that_an_earlier_process_has_lowered_is_raised_once_no_force_acts(
    reads: float, ended: bool, after: float
) -> None:
    """It stayed low if the force ended while no process ran. Where it is not as it was left, it belongs to
    whoever has moved it."""
    with rtde_server() as server:
        first = Play(server)
        first.until(lambda: first.code() == 0)
        first.step(estimate(0.0, contact(newtons=20.0)))
        assert first.state()["lowered"] == 0.1
        first.until(lambda: first.inputs.get("speed_slider_fraction") == (0.1,))
        first.listener.close()
        server.controller.set_output("target_speed_fraction", (reads,))
        second = Play(server)
        try:
            second.listener.command({"type": "restore", "decisions": [], "lowered": 0.1})
            second.until(lambda: second.code() == 0 and second.slider_is_read())
            assert second.state()["lowered"] == 0.1
            force = () if ended else (contact(newtons=20.0),)
            for t in (5.0, 5.5, 5.9):
                second.step(estimate(t, *force))
            assert second.inputs["speed_slider_fraction"] == (0.1,)
            second.step(estimate(6.1, *force))
            for _ in range(50 if after == 0.1 else 0):
                second.listener.tick(time.monotonic())
                time.sleep(0.002)
            second.until(lambda: second.inputs["speed_slider_fraction"] == (after,))
            second.until(lambda: (second.state()["lowered"] is None) == ended)
            told = [e["reason"] for e in second.events("action") if "earlier process" in e["reason"]]
            assert (
                told
                == {
                    (0.1, True): ["done: raised to 100 %; an earlier process had left it at 10 %"],
                    (0.1, False): [],
                    (0.3, True): ["left at 10 % by an earlier process; somebody has set 30 % since"],
                }[reads, ended]
            )
        finally:
            second.listener.close()


def test_registers_of_another_client_do_not_keep_the_slider_low() -> None:
    """All inputs had to be granted, those of the registers too."""
    with rtde_server() as server:
        other = RtdeInputs("127.0.0.1", server.port, {"a": ["input_int_register_47"]})
        _poll_until(other, lambda: other.ready)
        server.controller.set_output("target_speed_fraction", (0.1,))
        made = Play(server)
        try:
            made.listener.command({"type": "restore", "decisions": [], "lowered": 0.1})
            made.until(lambda: "target_speed_fraction" in made.listener._inputs.values)  # type: ignore[union-attr]
            made.until(lambda: made.events("action"))
            for t in (0.0, 1.1):
                made.step(estimate(t))
            made.until(lambda: made.inputs.get("speed_slider_fraction") == (1.0,))
            assert "raised to 100 %" in made.events("action")[-1]["reason"]
        finally:
            made.listener.close()
            other.close()


def test_registers_of_another_client_do_not_make_the_slider_fail() -> None:
    """Its state stayed that of the attempt before the connection, although it had been written since."""
    with rtde_server() as server:
        other = RtdeInputs("127.0.0.1", server.port, {"a": ["input_int_register_47"]})
        _poll_until(other, lambda: other.ready)
        made = Play(server)
        try:
            made.step(estimate(0.0, contact(newtons=20.0)))
            assert made.state()["actions"]["slow"]["state"] == "failing"
            made.until(lambda: made.inputs.get("speed_slider_fraction") == (0.1,))
            made.until(lambda: made.state()["actions"]["tell"]["error"])
            made.until(lambda: made.state()["actions"]["slow"]["state"] == "ok")
            assert made.state()["actions"]["tell"]["state"] == "failing"
        finally:
            made.listener.close()
            other.close()


def test_a_reading_of_before_a_lost_connection_decides_nothing() -> None:
    outputs = ["target_speed_fraction"]
    with rtde_server() as server:
        inputs = RtdeInputs("127.0.0.1", server.port, {}, outputs)
        _poll_until(inputs, lambda: outputs[0] in inputs.values)
    _poll_until(inputs, lambda: bool(inputs.error))
    assert not inputs.values
    inputs.close()


def test_a_slider_is_low_until_its_raise_is_written_and_never_before_it_was_lowered() -> None:
    """A process that ended in between left it low for ever, or said that somebody had moved it."""
    with rtde_server() as server:
        made = Play(server)
        made.step(estimate(0.0, contact(newtons=20.0)))
        assert made.state()["lowered"] is None
        made.step(estimate(0.1))
        made.until(lambda: made.code() == 0)
        assert "speed_slider_fraction" not in made.inputs, "raised, although it had not been lowered"
        made.step(estimate(0.2, contact(newtons=20.0)))
        made.until(lambda: made.inputs.get("speed_slider_fraction") == (0.1,))
        assert made.state()["lowered"] == 0.1
    try:
        made.until(lambda: made.state()["actions"]["slow"]["state"] == "failing")
        made.step(estimate(0.3))
        assert made.state()["lowered"] == 0.1
        with rtde_server(port=server.port) as again:
            made.inputs = again.controller.inputs
            made.until(lambda: made.inputs.get("speed_slider_fraction") == (1.0,))
            assert made.state()["lowered"] is None
    finally:
        made.listener.close()


def test_a_raised_slider_is_reported_at_once() -> None:
    """A process that ended within the next 0.25 s had the next one say that somebody had moved it."""
    with rtde_server() as server:
        server.controller.set_output("target_speed_fraction", (0.1,))
        made = Play(server)
        try:
            made.listener.command({"type": "restore", "decisions": [], "lowered": 0.1})
            made.until(made.slider_is_read)
            made.step(estimate(0.0))
            assert made.state()["lowered"] == 0.1
            made.reports.clear()
            made.step(estimate(1.1))
            assert made.state()["lowered"] is None
        finally:
            made.listener.close()


def test_a_level_without_restore_that_ends_before_the_connection_is_not_written_later() -> None:
    """The slider was lowered after the level had ended, and stayed low."""
    actions = {"slow": {"type": "speed_slider", "fraction": 0.1}, "tell": {"type": "registers"}}
    with rtde_server() as server:
        made = Play(server, {**RULES, "actions": actions})
        try:
            made.step(estimate(0.0, contact(newtons=20.0)))
            made.step(estimate(0.1))
            made.until(lambda: made.code() == 0 and made.slider_is_read())
            made.listener.tick(time.monotonic())
            assert "speed_slider_fraction" not in made.inputs
        finally:
            made.listener.close()


@pytest.mark.parametrize(
    ("reads", "told"),
    [(0.1, "done: raised to 100 %; an"), (0.3, "left at 10 % by an earlier process; somebody has set 30 %")],
)
def test_a_restored_latch_raises_the_slider_as_soon_as_it_is_acknowledged(reads: float, told: str) -> None:
    """It was raised even where somebody had moved it."""
    rules = {**RULES, "rules": [{**RULES["rules"][0], "collision": {"force": 50.0, "actions": ["slow"]}}]}
    begin = {
        "rule": "arm", "level": "collision", "kind": "begin", "actions": ["slow"], "t": 0.0,
        "probability": 1.0, "contact": 1, "link": "forearm", "link_index": 3, "point": [0, 0, 0],
        "point_base": [0, 0, 0], "force_base": [0, 0, 1], "force": 1.0,
    }  # fmt: skip
    with rtde_server() as server:
        server.controller.set_output("target_speed_fraction", (reads,))
        made = Play(server, rules)
        try:
            made.listener.command({"type": "restore", "decisions": [begin], "lowered": 0.1})
            made.until(made.slider_is_read)
            for t in (0.0, 2.0):
                made.step(estimate(t))
            assert made.state()["lowered"] == 0.1
            made.listener.command({"type": "acknowledge", "rule": None})
            made.until(lambda: made.state()["lowered"] is None)
            assert made.events("action")[-1]["reason"].startswith(told)
            if reads == 0.1:
                made.until(lambda: made.inputs.get("speed_slider_fraction") == (1.0,))
        finally:
            made.listener.close()


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


def test_a_level_that_begins_before_the_connection_lowers_the_slider_as_soon_as_there_is_one() -> None:
    with rtde_server() as server:
        made = Play(server)
        try:
            made.step(estimate(0.0, contact(newtons=20.0)))
            made.until(lambda: made.inputs.get("speed_slider_fraction") == (0.1,))
        finally:
            made.listener.close()


@pytest.mark.parametrize("ended", [False, True])
def test_after_a_lost_connection_the_slider_is_lowered_again_while_the_level_lasts_and_not_later(
    ended: bool,
) -> None:
    with rtde_server() as server:
        made = Play(server)
        made.until(lambda: made.code() == 0)
        made.step(estimate(0.0, contact(newtons=20.0)))
        made.until(lambda: made.inputs.get("speed_slider_fraction") == (0.1,))
        if ended:
            made.step(estimate(0.1))
            made.until(lambda: made.inputs["speed_slider_fraction"] == (1.0,))
    try:
        made.until(lambda: made.state()["actions"]["slow"]["state"] == "failing")
        with rtde_server(port=server.port) as again:
            # As whoever moved it since has left it.
            again.controller.inputs["speed_slider_fraction"] = (0.3,)
            made.inputs = again.controller.inputs
            made.until(lambda: made.code() in (0, 41))
            for _ in range(100):
                made.listener.tick(time.monotonic())
                time.sleep(0.002)
            assert made.inputs["speed_slider_fraction"] == ((0.3,) if ended else (0.1,))
    finally:
        made.listener.close()


def test_a_recipe_that_was_refused_is_asked_for_once_by_the_next_connection() -> None:
    """A second request for the same inputs would find them in use, by ourselves."""
    taken = {"a": ["input_int_register_47"]}
    with rtde_server() as server:
        first, second = (RtdeInputs("127.0.0.1", server.port, taken) for _ in range(2))
        _poll_until(first, lambda: first.ready)
        _poll_until(second, lambda: bool(second.refused))
        first.close()
    _poll_until(second, lambda: bool(second.error))
    assert not second.refused
    with rtde_server(port=server.port):
        _poll_until(second, lambda: second.ready)
        deadline = time.monotonic() + 1.5
        _poll_until(second, lambda: time.monotonic() > deadline)
        assert second.ready
        assert not second.refused
    second.close()


def _poll_until(inputs: RtdeInputs, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline
        inputs.poll(time.monotonic())
        time.sleep(0.002)
