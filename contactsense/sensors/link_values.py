"""Values of the link sensors by field: `wrist_wrench`, and `link_wrenches.NAME` for each further one."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar, cast

Record = TypeVar("Record")

WRIST = "wrist_wrench"
_OTHERS = "link_wrenches."


def by_field(wrist_wrench: Any, link_wrenches: Mapping[str, Any] | None) -> dict[str, Any]:
    """The values that are there, of the two fields of a `Sample` or of any record with these fields.

    Raises:
        TypeError: `link_wrenches` are not by name of the sensor.
    """
    if link_wrenches is None:
        link_wrenches = {}
    elif not isinstance(link_wrenches, Mapping):
        raise TypeError(
            "link_wrenches: expected values by name of the sensor, as in {'forearm': value}, "
            f"got {type(link_wrenches).__name__}"
        )
    found = {_OTHERS + name: x for name, x in link_wrenches.items() if x is not None}
    if wrist_wrench is not None:
        found[WRIST] = wrist_wrench
    return found


def as_fields(values: Mapping[str, Any]) -> dict[str, Any]:
    """The reverse of `by_field`: `wrist_wrench` and `link_wrenches`, None where there are no values."""
    others = {
        name.removeprefix(_OTHERS): value
        for name, value in values.items()
        if name != WRIST and value is not None
    }
    return {WRIST: values.get(WRIST), "link_wrenches": others or None}


def name_of(field: str) -> str | None:
    """Name of a sensor of `Scene.link_wrenches`; None: the wrist sensor."""
    return None if field == WRIST else field.removeprefix(_OTHERS)


def with_values(record: Record, values: Mapping[str, Any]) -> Record:
    """The same `Sample` or `SampleBlock` with other values of some link sensors."""
    if not values:
        return record
    fields = cast(Any, record)
    before = by_field(fields.wrist_wrench, fields.link_wrenches)
    return cast(Record, replace(fields, **as_fields(before | dict(values))))


def column_of(field: str) -> str:
    """Prefix of the columns of a recording that hold a sensor's readings: `wrist_wrench`, `NAME_wrench`."""
    return WRIST if field == WRIST else f"{field.removeprefix(_OTHERS)}_wrench"
