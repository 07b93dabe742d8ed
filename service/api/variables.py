"""Settings in environment variables: their names, and settings that belong to a group."""

import contextlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from contactsense.robots.files.field_errors import Place, joined
from contactsense.robots.files.near_names import did_you_mean
from contactsense.service.json_objects import parse_json

PREFIX = "CONTACTSENSE_"
"""Prefix of the environment variables; the name of the setting follows in capitals, as in
`CONTACTSENSE_ROBOT_HOST`."""
GROUPED = (
    ("journal", "events", "path"),
    ("reactions", "reactions", "file"),
    ("recordings", "recording", "folder"),
    ("source", "controllers", "source"),
    ("xmlrpc_port", "controllers", "xmlrpc_port"),
    ("line_port", "controllers", "line_port"),
    ("controller_host", "controllers", "host"),
    ("controller_clients", "controllers", "clients"),
)
"""Options and variables that are fields of a group of settings: name, group, field."""


def from_json(value: Any) -> Any:
    """Parse a group of settings from an environment variable."""
    if not isinstance(value, str):
        return value
    try:
        return parse_json(value)
    except ValueError as error:
        raise ValueError(f"expected an object in JSON ({error}), got {value!r:.60}") from None


def read_variables(
    environment: Mapping[str, str], names: Iterable[str]
) -> tuple[dict[str, Any], Callable[[Place], str]]:
    """Settings that are environment variables. An empty one counts as unset: compose files set what they do
    not know to nothing.

    Args:
        environment: All variables.
        names: Names of the settings.

    Returns:
        Values by name of the setting, and how the user wrote a setting or a field within it.
    """
    environment = {name: value for name, value in environment.items() if value.strip()}
    given: dict[str, Any] = {
        name: environment[PREFIX + name.upper()] for name in names if PREFIX + name.upper() in environment
    }
    members: dict[Place, str] = {}
    for name, group, field in GROUPED:
        value = environment.get(PREFIX + name.upper())
        if value is None or (name == group and value.lstrip().startswith("{")):
            continue
        others = {} if name == group else _object(given.get(group, {}))
        if others is not None:
            given[group] = {**others, field: value}
            members[(group, field)] = name

    def spelled(place: Place) -> str:
        if place[:2] in members:
            return joined((PREFIX + members[place[:2]].upper(), *place[2:]))
        return joined((PREFIX + str(place[0]).upper(), *place[1:]))

    return given, spelled


def misspelled(environment: Mapping[str, str], names: Iterable[str]) -> tuple[str, ...]:
    """Variables that are no settings but nearly, one readable line each: they have no effect.

    Args:
        environment: All variables.
        names: Names of the settings.
    """
    known = {name.upper() for name in (*names, *(name for name, _, _ in GROUPED))}
    own = [name.removeprefix(PREFIX) for name in environment if name.startswith(PREFIX)]
    return tuple(
        f"{PREFIX}{name} has no effect: there is no such setting{near}"
        for name in own
        if name not in known and (near := did_you_mean(name, known))
    )


def empty_token(environment: Mapping[str, str]) -> tuple[str, ...]:
    """A warning if the token is an empty variable: whoever sets it believes that requests need one."""
    name = f"{PREFIX}TOKEN"
    empty = name in environment and not environment[name].strip()
    return (f"{name} is empty, which counts as no token",) if empty else ()


def _object(value: Any) -> dict[str, Any] | None:
    """The fields of a group that is a variable itself; None if it is no JSON object."""
    with contextlib.suppress(ValueError):
        value = from_json(value)
    return dict(value) if isinstance(value, Mapping) else None
