"""Where in the user's data one of pydantic's errors is."""

from collections.abc import Iterable, Sequence
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel, Tag

Place = tuple[str | int, ...]
"""Path to a field: names of fields, keys and indices."""


class _Branch(NamedTuple):
    """One of the types that a value may have."""

    type: Any
    label: str | None
    """Name of the branch in locations, where its type says another one."""


class Found(NamedTuple):
    """What is at a place within the data."""

    place: Place
    """The path as the user wrote it."""
    types: tuple[Any, ...]
    """Types that the value there may have, apart from null."""
    may_be_null: bool
    """Whether there may be no value."""

    @property
    def fields(self) -> set[str]:
        """Names of the fields that may stand there."""
        return {
            info.alias or name
            for kind in self.types
            if _is_model(kind)
            for name, info in kind.model_fields.items()
        }


def find(annotation: Any, location: Iterable[str | int]) -> Found:
    """Follow a location of pydantic through a type.

    In a union of several types, pydantic inserts the name of the branch that it tried, or its tag. The user
    never wrote it.

    Args:
        annotation: Type of the whole data.
        location: Path with the names of branches.
    """
    place: list[str | int] = []
    here = [annotation]
    branches = _branches(annotation)
    for step in location:
        if len(branches) > 1:
            branches = [branch for branch in branches if _is_meant(branch, step)] or branches[:1]
            continue
        place.append(step)
        here = [inner for at in branches for inner in _within(at.type, step)]
        branches = [branch for inner in here for branch in _branches(inner)]
    return Found(tuple(place), tuple(branch.type for branch in branches), any(map(_may_be_null, here)))


def places_of(annotation: Any, name: str) -> tuple[Place, ...]:
    """Where a field with this name may stand: in a model, or in models that are its fields."""
    found: list[Place] = []
    for kind in (branch.type for branch in _branches(annotation)):
        for field, info in kind.model_fields.items() if _is_model(kind) else ():
            key = info.alias or field
            found += [(key,)] if key == name else []
            found += [(key, *place) for place in places_of(info.annotation, name)]
    return tuple(dict.fromkeys(found))


def _branches(annotation: Any, label: str | None = None) -> list[_Branch]:
    if get_origin(annotation) is Annotated:
        inner, *remarks = get_args(annotation)
        tag = next((remark.tag for remark in remarks if isinstance(remark, Tag)), label)
        return _branches(inner, tag)
    if get_origin(annotation) in (Union, UnionType):
        return [
            branch for part in get_args(annotation) if part is not type(None) for branch in _branches(part)
        ]
    return [_Branch(annotation, label)]


def _may_be_null(annotation: Any) -> bool:
    if get_origin(annotation) is Annotated:
        return _may_be_null(get_args(annotation)[0])
    return get_origin(annotation) in (Union, UnionType) and any(
        part is type(None) or _may_be_null(part) for part in get_args(annotation)
    )


def _is_meant(branch: _Branch, step: str | int) -> bool:
    kind = branch.type
    if branch.label is not None:
        return branch.label == step
    if _is_model(kind):
        tags = {
            value
            for info in kind.model_fields.values()
            if get_origin(info.annotation) is Literal
            for value in get_args(info.annotation)
        }
        return step == kind.__name__ or step in tags
    origin = get_origin(kind)
    return origin is not None and str(step).startswith(getattr(origin, "__name__", "-"))


def _within(kind: Any, step: str | int) -> Sequence[Any]:
    """Types of what `step` leads to."""
    if _is_model(kind):
        return [info.annotation for name, info in kind.model_fields.items() if step in (name, info.alias)]
    parts = get_args(kind)
    if get_origin(kind) is dict:
        return parts[1:]
    if get_origin(kind) in (tuple, list) and isinstance(step, int):
        # A tuple with a type for each position, or one type for all.
        own = () if Ellipsis in parts else parts[step : step + 1]
        return own or parts[:1]
    return []


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
