"""Names of settings as the user of a command writes them, for messages."""

from collections.abc import Callable, Iterable

import click

from contactsense.robots.files.field_errors import Place, joined
from contactsense.service.api.settings import OptionsError
from contactsense.service.viewer.service_calls import UrlError

Grouped = Iterable[tuple[str, str, str]]
"""Options that are fields of a group of settings: option, group, field."""


def refusal(error: Exception) -> click.ClickException:
    """What ends a command with one line: with status 2 if its options are wrong, and 1 if what they name
    cannot be used."""
    kind = click.UsageError if isinstance(error, OptionsError | UrlError) else click.ClickException
    return kind(str(error))


def as_options(grouped: Grouped = ()) -> Callable[[Place], str]:
    """How the running command spells a field of `Settings`: as its option, such as --ft-host.

    Args:
        grouped: Options of the command that belong to a group of settings.
    """
    options = {option.name: option.opts[0] for option in click.get_current_context().command.params}
    members: dict[Place, str] = {(group, field): option for option, group, field in grouped}

    def spelled(place: Place) -> str:
        option = members.get(place[:2])
        if option is not None:
            return joined((options[option], *place[2:]))
        return joined((options.get(str(place[0]), str(place[0])), *place[1:]))

    return spelled
