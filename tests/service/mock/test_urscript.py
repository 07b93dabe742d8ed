"""Programs in URScript: what the mock understands, and what it says it does not."""

import pytest

from contactsense.service.mock.urscript import ProgramReader, Statement, parse


def test_a_stop_program_in_pieces():
    reader = ProgramReader()
    assert reader.feed(b"def stop_now():\n  stopj(4.5)  # at once\n") == []
    (program,) = reader.feed(b"end\n")
    assert (program.name, program.kind) == ("stop_now", "def")
    assert program.statements == (Statement("stopj", {"a": 4.5}),)
    assert program.unknown == ()


def test_several_programs_and_single_lines():
    text = (
        b'stopj(a=2.0)\nsec note():\n  textmsg("value: ", 3)\nend\n'
        b"\ndef go():\nmovej([0, 1, 2, 3, 4, 5], v=0.5)\nend\n"
    )
    line, note, go = ProgramReader().feed(text)
    assert (line.kind, line.statements[0].arguments) == ("line", {"a": 2.0})
    assert (note.kind, note.statements[0].arguments) == ("sec", {"s1": "value: ", "s2": 3})
    assert go.statements[0].arguments == {"q": [0, 1, 2, 3, 4, 5], "v": 0.5}


def test_what_is_not_simulated_is_listed():
    text = (
        "def f():\n  while True:\n    sync()\n  end\n"
        "  movel(p[0, 0, 0, 0, 0, 0])\n  x = 3\n  stopj(1, 2, 3)\nend\n"
    )
    (program,) = ProgramReader().feed(text.encode())
    assert program.statements == (Statement("sync", {}),)
    assert program.unknown == ("while True:", "end", "movel(p[0, 0, 0, 0, 0, 0])", "x = 3", "stopj(1, 2, 3)")


def test_a_secondary_program_does_not_move():
    program = parse("sec f():\n  stopj(2)\n  popup('hello')\nend")
    assert [statement.name for statement in program.statements] == ["popup"]
    assert program.unknown == ("stopj(2)",)


def test_on_one_line():
    program = parse("def f(): stopj(3) end")
    assert program.statements == (Statement("stopj", {"a": 3}),)


@pytest.mark.parametrize("offset", [0, 24])
def test_the_script_of_ur_rtde_names_its_registers(offset):
    text = f"def rtde_control():\n  reg_offset_int = {offset}\n  while True:\n    x = 1\n  end\nend\n"
    (program,) = ProgramReader().feed(text.encode())
    assert (program.name, program.register_offset) == ("rtde_control", offset)
