"""docs/reaction_fields.md, and the ways in which a field may be written."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from contactsense.robots.files.field_errors import describe
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction
from contactsense.service.reactions.page import TABLES, action_tables, reaction_page
from contactsense.service.reactions.rules import Inputs

PAGE = Path(__file__).parents[3] / "docs" / "reaction_fields.md"


def test_the_page_is_what_the_code_says() -> None:
    made = "python -m contactsense.service.reactions.page > docs/reaction_fields.md"
    assert reaction_page() == PAGE.read_text(encoding="utf-8"), made


@pytest.mark.parametrize("model", [*TABLES.values(), *action_tables().values()])
def test_every_field_has_a_meaning(model: type[BaseModel]) -> None:
    assert not [name for name, field in model.model_fields.items() if not field.description]


def test_the_page_has_ranges_and_units() -> None:
    page = reaction_page()
    assert "| `fraction` |  | required | 0.01 to 1 |" in page
    assert "| `force` | N | required | above 0, at most 5000 |" in page
    assert "| `while` |  | `any` |  |" in page


def test_registers_by_the_names_of_their_fields() -> None:
    given: dict[str, Any] = {
        "type": "registers",
        "code": "input_int_register_40",
        "force": "input_double_register_41",
        "link": "input_int_register_46",
        "time": "27",
        "point": ["input_double_register_24", 25, 26],
        "heartbeat": "input_bit_register_70",
    }
    action = RegistersAction.model_validate(given)
    assert (action.code, action.force, action.link, action.heartbeat) == (40, 41, 46, 70)
    assert action.point == (24, 25, 26)
    assert action.time == 27


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("link", "input_double_register_46", "the number N of a register input_int_register_N, or this name"),
        ("link", "46 ", "expected the number N of a register input_int_register_N, or this name, got '46 '"),
        ("force", "input_double_register_48", "force: expected a number of at most 47"),
        ("heartbeat", "output_bit_register_64", "the number N of a register input_bit_register_N"),
        ("period", True, "period: expected a number, got true"),
    ],
)
def test_a_wrong_register_is_told_what_it_is(field: str, value: object, complaint: str) -> None:
    with pytest.raises(ValidationError) as refused:
        RegistersAction.model_validate({"type": "registers", field: value})
    assert complaint in describe(refused.value, RegistersAction)


def test_a_truth_value_is_no_fraction() -> None:
    with pytest.raises(ValueError, match="fraction"):
        SpeedSliderAction.model_validate({"type": "speed_slider", "fraction": True})


def test_an_input_that_is_a_number_is_told_what_it_may_be() -> None:
    with pytest.raises(ValueError, match="such as output_int_register_24, got the number 24"):
        Inputs.model_validate({"announce": 24})
