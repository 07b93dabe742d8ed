"""Files of fields that a user has written: whatever cannot be used is said in one line."""

from math import inf
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from contactsense.robots.files.yaml_fields import Dumper, fields_in, read_fields

REPEATED = b"a: [&0 [1], " + b", ".join(
    b"&%d [%s]" % (i + 1, b", ".join(9 * [b"*%d" % i])) for i in range(12)
)
REPEATED += b"]"
"""Twelve lists, each of which has the one before nine times: 9^12 values."""


def test_fields_are_those_of_yaml() -> None:
    text = "base: &base {a: 1}\nmore:\n  <<: *base\n  a: 2\n  1: one\n"
    assert fields_in(text, "file", "a: 1") == {"base": {"a": 1}, "more": {"a": 2, 1: "one"}}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10),
        ("-08", -8),
        ("0500", 500),
        ("0x1F", 31),
        ("0b101", 5),
        ("1_000", 1000),
        ("1e-3", 1e-3),
        ("1E3", 1e3),
        ("1.5e-3", 1.5e-3),
        ("-.5", -0.5),
        ("-.inf", -inf),
        (308 * "9", 10**308 - 1),
        pytest.param("-" + 5000 * "9", -inf, id="digits"),
        pytest.param("-0x" + 5000 * "f", -inf, id="hexadecimal digits"),
        pytest.param("0b" + 5000 * "1", inf, id="binary digits"),
        ("2024-01-31", "2024-01-31"),
        ("2024-13-45", "2024-13-45"),
        ("1:30", "1:30"),
        ("1:30.5", "1:30.5"),
        ("10.0.0.1", "10.0.0.1"),
        ("1e", "1e"),
        ("9,81", "9,81"),
    ],
)
def test_numbers_are_what_they_look_like(text: str, value: object) -> None:
    """In YAML 1.1, leading zeros are octal, colons are base 60, and 1e-3 is text."""
    (found,) = fields_in(f"a: {text}", "file", "a: 1").values()
    assert (type(found), found) == (type(value), value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"a: !!timestamp 2024-13-45",
            "file.yaml: not YAML: expected a value of the type timestamp, got '2024-13-45'",
        ),
        (b"a: 0x_", "file.yaml: not YAML: expected a value of the type int, got '0x_'"),
        (b"a: !!float _", "file.yaml: not YAML: expected a value of the type float, got '_'"),
        (b"a: !!bool maybe", "file.yaml: not YAML: expected a value of the type bool, got 'maybe'"),
        (b"a: !!timestamp now", "file.yaml: not YAML: expected a value of the type timestamp, got 'now'"),
        (b"a: !!set [1]", "file.yaml: not YAML: expected a value of the type set, got several"),
        pytest.param(REPEATED, "file.yaml: not YAML: aliases that repeat more than", id="aliases"),
        (b"", "file.yaml: expected fields such as `robot: ur5e`, got nothing"),
        (b"# a comment", "file.yaml: expected fields such as `robot: ur5e`, got nothing"),
        (b"- 1", "file.yaml: expected fields such as `robot: ur5e`, got [1]"),
        (b"1: 2", "file.yaml: expected names of fields such as `robot: ur5e`, got 1"),
        (b"a: 1\nnull: 2", "file.yaml: expected names of fields such as `robot: ur5e`, got None"),
        (b"\xb2\xff\x00", "file.yaml: cannot read the scene: expected text in UTF-8"),
        (b"a: 1\nb: {c: 1,\n c: 2}", "file.yaml: c: expected once, got in line 2 and in line 3"),
        (b"a: [", "file.yaml: not YAML: "),
        (b"a: \x01", "file.yaml: not YAML: "),
        (b"a: &a {b: *a}", "file.yaml: not YAML: "),
        (b"a: &a [1, *a]", "file.yaml: not YAML: "),
        pytest.param(b"a: " + 5000 * b"[" + 5000 * b"]", "file.yaml: nested too deeply", id="nested"),
        (None, "file.yaml: cannot read the scene: No such file or directory"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "file.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=r"file\.yaml") as refused:
        read_fields(path, "the scene", "robot: ur5e")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert type(refused.value) is ValueError


@given(st.text())
@example("09")
@example("1e3")
@example("0x_")
@example("1:30")
@example("2024-13-40")
def test_what_is_written_is_read_as_it_was(text: str) -> None:
    """Here, and by those who read YAML 1.1."""
    written = yaml.dump({"a": text}, Dumper=Dumper, allow_unicode=True)
    assert fields_in(written, "file", "a: 1") == yaml.safe_load(written) == {"a": text}


def test_a_byte_order_mark_is_left_out() -> None:
    assert fields_in("\ufeffa: 1", "file", "a: 1") == {"a": 1}
