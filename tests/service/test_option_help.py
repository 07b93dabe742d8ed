"""The help of options that are settings of the service: what each is for, and its default."""

import click
import pytest
from pydantic import BaseModel

from contactsense.service.api.settings import Settings
from contactsense.service.api.variables import GROUPED
from contactsense.service.cli.check import check
from contactsense.service.cli.record import record
from contactsense.service.cli.serve import serve

GROUPS = {option: (group, field) for option, group, field in GROUPED}


def default_of(name: str) -> object:
    """Default of a setting; None where there is none of that name."""
    group, field = GROUPS.get(name, (None, name))
    model: type[BaseModel] = Settings if group is None else type(Settings.model_fields[group].default)
    return model.model_fields[field].default if field in model.model_fields else None


@pytest.mark.parametrize("command", [serve, record, check], ids=lambda command: command.name)
def test_every_option_says_what_it_is_for_and_its_default(command: click.Command) -> None:
    for option in command.params:
        if not isinstance(option, click.Option):
            continue
        assert option.help, option.name
        assert option.help[0].isupper(), option.name
        default = default_of(option.name or "")
        if isinstance(default, str | float | int) and not isinstance(default, bool):
            shown = default if isinstance(default, str) else f"{default:.10g}"
            assert f"  [default: {shown}]" in option.help, option.name
        assert ("may be repeated" in option.help) == option.multiple, option.name


def test_ports_of_robot_programs_are_closed_by_default() -> None:
    for option in serve.params:
        if option.name in ("xmlrpc_port", "line_port"):
            assert isinstance(option, click.Option)
            assert str(option.help).endswith("; 0 takes a free one.  [default: closed]")
