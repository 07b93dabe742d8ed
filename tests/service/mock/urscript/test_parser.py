"""Programs in URScript: what the mock understands, and what it says it does not."""

import pytest

from contactsense.service.mock.urscript.parser import ProgramReader, Statement, parse


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
        "  movel(p[0, 0, 0, 0, 0, 0])\n  x = 3\n  stopj(wanted)\nend\n"
    )
    (program,) = ProgramReader().feed(text.encode())
    assert program.statements == (Statement("sync", {}),)
    assert program.unknown == ("while True:", "end", "movel(p[0, 0, 0, 0, 0, 0])", "x = 3", "stopj(wanted)")


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


@pytest.mark.parametrize(
    ("call", "error"),
    [
        ("movej()", "movej: expected q, got nothing"),
        ("movej([1, 2, 3])", "movej: q: expected a list of 6 numbers, got [1, 2, 3]"),
        ("movej([0, 0, 0, 0, 0, '1'])", "movej: q: expected a number, got '1'"),
        ("movej([0, 0, 0, 0, 0, 0], v=0)", "movej: v: expected a number above 0, got 0"),
        ("movej([0, 0, 0, 0, 0, 0], speed=1)", "movej: expected arguments out of q, a, v, t, r, got speed"),
        ("sync(t=1)", "sync: expected arguments out of none, got t"),
        ("stopj(0)", "stopj: a: expected a number above 0, got 0"),
        ("stopj(True)", "stopj: a: expected a number, got True"),
        ("stopj(1, 2)", "stopj: expected at most 1 arguments, got 2"),
        ("stopj(1, a=2)", "stopj: a: expected one value, got two"),
        ("sleep('a')", "sleep: t: expected a number, got 'a'"),
        ("sleep(1e999)", "sleep: t: expected a number, got inf"),
        (f"sleep({10**400})", "sleep: t: expected a number, got 10"),
        ("sleep(-1)", "sleep: t: expected a number of at least 0, got -1"),
        ("popup('look', blocking=1)", "popup: blocking: expected True or False, got 1"),
        (
            "rtde_set_watchdog('beat', 10)",
            "variable_name: expected an RTDE input such as 'input_int_register_47', got 'beat'",
        ),
        ("rtde_set_watchdog('output_int_register_1', 10)", "expected an RTDE input such as"),
        ("rtde_set_watchdog(47, 10)", "expected an RTDE input such as 'input_int_register_47', got 47"),
        (
            "rtde_set_watchdog('speed_slider_mask', 0)",
            "rtde_set_watchdog: min_frequency: expected a number above 0, got 0",
        ),
        (
            "rtde_set_watchdog('input_int_register_1', 1, 'go')",
            "action: expected one of pause, stop, ignore, got 'go'",
        ),
        ("write_output_integer_register(1)", "write_output_integer_register: expected value, got nothing"),
        ("write_output_integer_register(48, 1)", "address: expected an integer from 0 to 47, got 48"),
        (
            "write_output_integer_register(1, 1.5)",
            "value: expected an integer from -2147483648 to 2147483647",
        ),
        ("write_output_integer_register(1, 3000000000)", "value: expected an integer from -2147483648"),
        ("write_output_float_register(1, 'a')", "write_output_float_register: value: expected a number"),
        ("write_output_boolean_register(1, 2)", "value: expected True or False, got 2"),
    ],
)
def test_wrong_arguments_are_errors(call, error):
    program = parse(f"def f():\n  sync()\n  {call}\nend")
    (said,) = program.errors
    assert error in said
    assert program.unknown == ()


def test_what_python_cannot_parse_is_not_simulated():
    for line in ("sleep({[]})", "sleep(" + "-" * 10_000 + "1)", "sleep(\0)"):
        assert parse(line).unknown == (line,)


def test_texts_can_be_sent():
    (statement,) = parse(r"textmsg('\ud800')").statements
    assert statement.arguments["s1"].encode() == b"?"
