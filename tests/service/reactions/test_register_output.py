"""Which decision the registers show, and with which force."""

from typing import Any, cast

from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.register_output import RegisterOutput
from contactsense.service.reactions.rtde_inputs import RtdeInputs
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


class Inputs:
    """A controller that takes all that is written."""

    def __init__(self) -> None:
        self.written: list[tuple[Any, ...]] = []

    def write(self, _: str, values: tuple[Any, ...]) -> bool:
        """As `RtdeInputs.write`."""
        self.written.append(values)
        return True


def test_nothing_is_written_before_the_latches_of_an_earlier_process_are_known() -> None:
    """A robot program would take the collision for acknowledged."""
    inputs, tell = Inputs(), RegistersAction(type="registers", period=0.02)
    output = RegisterOutput(tell, "tell", cast(RtdeInputs, inputs))
    assert not output.write(1.5, False, 10.0)
    assert (inputs.written, output.problem) == ([], "the latched collisions of before are not known yet")
    output.latches_known = True
    assert output.problem == "not connected"
    assert output.is_due(10.0)
    for now in (10.0, 10.02):
        assert output.write(1.5, True, now)
        # Up to 1 ms early, as the next look at the clock may come that much too late.
        later = (0.0, 0.01, 0.0185, 0.0195, 0.02)
        assert [output.is_due(now + after) for after in later] == [False, False, False, True, True]
    assert inputs.written == [(0, 0.0, beat, False, False, True) for beat in (True, False)]


def test_without_a_robot_nothing_is_written() -> None:
    output = RegisterOutput(RegistersAction(type="registers"), "tell", None)
    output.latches_known = True
    assert not output.write(1.5, False, 10.0)
