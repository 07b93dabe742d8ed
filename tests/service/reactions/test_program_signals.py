"""Acknowledgements and announcements that a robot program makes by its outputs."""

from contactsense.service.reactions.program_signals import ProgramSignals
from contactsense.service.reactions.rules import Inputs

ACKNOWLEDGE, ANNOUNCE = "output_int_register_19", "output_int_register_20"


def test_only_leaving_zero_acknowledges() -> None:
    signals = ProgramSignals(Inputs(acknowledge=ACKNOWLEDGE))
    told = [signals.acknowledged({ACKNOWLEDGE: value}) for value in (1, 1, 0, 2, 3, 0, 0, 1)]
    assert told == [False, False, False, True, False, False, False, True]
    assert signals.announced({ACKNOWLEDGE: 0}) is None


def test_every_change_announces_but_not_the_first_value() -> None:
    signals = ProgramSignals(Inputs(announce=ANNOUNCE))
    told = [signals.announced({ANNOUNCE: value}) for value in (3, 3, 4, 0, 3)]
    assert told == [None, None, 4, 0, 3]
    assert not signals.acknowledged({ANNOUNCE: 5})


def test_outputs_that_are_not_read_yet_tell_nothing() -> None:
    signals = ProgramSignals(Inputs(acknowledge=ACKNOWLEDGE, announce=ANNOUNCE))
    assert signals.names == (ACKNOWLEDGE, ANNOUNCE)
    assert not signals.acknowledged({})
    assert signals.announced({}) is None
    assert ProgramSignals(Inputs()).names == ()
