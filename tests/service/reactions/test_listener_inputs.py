"""The connection to the controller's inputs: there is one where the rules need it, for what they need."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from contactsense.service.reactions.listener import ReactionListener
from contactsense.service.reactions.rules import ReactionRules
from tests.service.loopback import rtde_server
from tests.service.reactions.estimates import SCENE, contact, estimate
from tests.service.reactions.listener_play import Play


@contextmanager
def playing(**rules: Any) -> Iterator[Play]:
    """A listener with such rules, and one for collisions above 50 N with all of their actions."""
    collision = {"force": 50.0, "actions": list(rules.get("actions", ()))}
    arm = {"name": "arm", "links": ["any"], "collision": collision}
    with rtde_server() as server:
        made = Play(server, {"rules": [arm], **rules})
        try:
            yield made
        finally:
            made.listener.close()


def test_registers_are_written_also_where_nothing_is_read() -> None:
    with playing(actions={"tell": {"type": "registers"}}) as made:
        made.until(lambda: made.code() == 0)
        made.step(estimate(0.0, contact(newtons=60.0)))
        made.until(lambda: made.code() == 42)


def test_a_robot_program_acknowledges_also_where_nothing_is_written() -> None:
    with playing(inputs={"acknowledge": "output_bit_register_70"}) as made:
        made.server.controller.set_output("output_bit_register_70", (False,))
        made.step(estimate(0.0, contact(newtons=60.0)))
        made.until(lambda: "output_bit_register_70" in made.listener._signals._last)
        made.server.controller.set_output("output_bit_register_70", (True,))
        made.until(lambda: made.events("acknowledged"))


def test_rules_that_need_no_inputs_open_no_connection() -> None:
    """It would take one of the few that a controller has."""
    rules = {"rules": [{"name": "arm", "links": ["any"], "collision": {"force": 50.0}}]}
    listener = ReactionListener(ReactionRules.model_validate(rules), SCENE, "127.0.0.1")
    assert listener._inputs is None
    listener.close()


@pytest.mark.parametrize(("given", "port"), [({}, 30004), ({"rtde_port": 30104}, 30104)])
def test_the_port_is_that_of_rtde_unless_the_rules_name_another(given: dict[str, int], port: int) -> None:
    rules = {
        "robot": {"host": "192.0.2.1", **given},
        "inputs": {"acknowledge": "output_bit_register_70"},
        "rules": [{"name": "arm", "links": ["any"], "collision": {"force": 50.0}}],
    }
    listener = ReactionListener(ReactionRules.model_validate(rules), SCENE, "192.0.2.1")
    assert listener._inputs is not None
    assert listener._inputs._port == port
    listener.close()
