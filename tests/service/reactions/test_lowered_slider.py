"""The speed slider in the pipeline's process: lowered, raised, and taken over from an earlier process."""

import time

import pytest

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.service.reactions.rules import ReactionRules
from tests.service.loopback import rtde_server
from tests.service.reactions.estimates import SCENE, contact, estimate, sample
from tests.service.reactions.listener_play import RULES, Play, poll_until


@pytest.mark.parametrize(
    ("reads", "ended", "after"),
    [(0.1, True, 1.0), (0.1, False, 0.1), (0.3, True, 0.1)],
    ids=["no force acts", "a force acts", "somebody has moved it"],
)
def test_a_slider_that_an_earlier_process_has_lowered_is_raised_once_no_force_acts(
    reads: float, ended: bool, after: float
) -> None:
    """The force may have ended while no process ran. Where the slider is not as it was left, it belongs to
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
    """The slider needs its own inputs only, not those of the registers."""
    with rtde_server() as server:
        other = RtdeInputs("127.0.0.1", server.port, {"a": ["input_int_register_47"]})
        poll_until(other, lambda: other.ready)
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
    """An attempt before the connection fails; its state is that of what has been written since."""
    with rtde_server() as server:
        other = RtdeInputs("127.0.0.1", server.port, {"a": ["input_int_register_47"]})
        poll_until(other, lambda: other.ready)
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
        poll_until(inputs, lambda: outputs[0] in inputs.values)
    poll_until(inputs, lambda: bool(inputs.error))
    assert not inputs.values
    inputs.close()


def test_a_slider_is_low_until_its_raise_is_written_and_never_before_it_was_lowered() -> None:
    """The process may end in between: the next one must know whether to raise it."""
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
    """The process may end before its next regular report, and the next one would say that somebody has moved
    it."""
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


def test_a_slider_that_is_lowered_later_is_reported_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process may end before its next regular report, and the slider would stay low."""
    taken = False
    monkeypatch.setattr(RtdeInputs, "poll", lambda *_: None)
    monkeypatch.setattr(RtdeInputs, "write", lambda *_: taken)
    listener = ReactionListener(ReactionRules.model_validate(RULES), SCENE, "127.0.0.1")
    try:
        listener.receive(sample(0.0), estimate(0.0, contact(newtons=20.0)))
        listener.tick(100.0)
        listener.take_reports()
        listener.tick(100.01)
        assert listener.take_reports() == []
        taken = True
        listener.tick(100.02)
        assert [report["lowered"] for report in listener.take_reports()] == [0.1]
    finally:
        listener.close()


def test_a_level_without_restore_that_ends_before_the_connection_is_not_written_later() -> None:
    """Nothing would raise a slider that is lowered after its level has ended."""
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
    """Where somebody has moved it, it stays."""
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
