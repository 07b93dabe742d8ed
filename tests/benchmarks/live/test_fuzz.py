"""No spoiled byte breaks a parser of the wire, and the fuzzer would notice if one did."""

import pytest

from contactsense.benchmarks.live.fuzz import all_targets, fuzz
from contactsense.benchmarks.live.fuzz_target import Target

TARGETS = all_targets()


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_spoiled_inputs_do_no_harm(target: Target) -> None:
    result = fuzz(target, 500)
    assert result.first_defect == ""
    # The line socket refuses within its stream, by an answer, not by an exception.
    assert (result.refused > 0) == (target.name != "line socket")


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_many_spoiled_inputs_do_no_harm(target: Target) -> None:
    assert fuzz(target, 50_000 // len(TARGETS), seed=2).first_defect == ""


def test_a_parser_that_breaks_is_noticed() -> None:
    def parse(data: bytes) -> int:
        if not data:
            raise ValueError("too short")
        return data[20]

    result = fuzz(Target("broken", parse, ValueError, (b"x" * 30,)), 200)
    assert result.defects > 0
    assert "IndexError" in result.first_defect
