"""Which decision the registers show, and with which force."""

from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.register_output import RegisterOutput
from tests.service.reactions.engines import engine, rule, run
from tests.service.reactions.estimates import contact, estimate


def test_the_present_force_stays_where_another_level_begins_or_ends() -> None:
    """As when somebody acknowledges the collision of another rule."""
    tell = RegistersAction(type="registers")
    shown = {"force": 15.0, "actions": ["tell"]}
    machine = engine(
        rule(collision=None, contact=shown), rule(name="other"), actions={"tell": {"type": "registers"}}
    )
    output = RegisterOutput(tell, "tell", None)
    run(machine, estimate(0.0, contact(newtons=60.0)))
    output.select(machine.active)
    assert output.shown is not None
    assert output.shown.force == 60.0
    output.follow(machine, estimate(0.1, contact(newtons=30.0)))
    machine.acknowledge("other")
    output.select(machine.active)
    assert (output.shown.rule, output.shown.force) == ("r", 30.0)
    run(machine, estimate(0.2))
    output.select(machine.active)
    assert output.shown is None
