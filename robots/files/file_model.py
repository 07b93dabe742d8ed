"""Base of what is read from YAML files: immutable, no unknown fields, finite numbers, and no truth values for
numbers.

In YAML `yes`, `on` and `true` are truth values, which Python takes for 1 where a number is expected.
"""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Self, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from contactsense.robots.files.field_errors import Place, describe, reasons
from contactsense.robots.files.near_names import did_you_mean


class FieldError(ValueError):
    """Fields of an object that is made in Python are wrong. The message is one line: each field, the expected
    value and the given one."""

    # All of it is text, so that it can be sent from one process to another whatever was given.
    def __init__(self, message: str, reasons: dict[Place, str] | None = None, model: str = "") -> None:
        super().__init__(message)
        self.reasons = reasons or {}
        """Field -> what was expected and what was given."""
        self.model = model
        """Name of the class of which an object was to be made."""


if TYPE_CHECKING:  # type checkers know the fields of each model

    class _MadeInPython(BaseModel):
        pass

else:

    class _Maker(type(BaseModel)):
        """Only who makes an object in Python calls its class. As a part of another model it is validated with
        the whole, whose error names the place of the part."""

        def __call__(cls, /, *given: Any, **fields: Any) -> Any:
            try:
                return super().__call__(*given, **fields)
            except ValidationError as error:
                raise in_words(error, cls) from None

    class _MadeInPython(BaseModel, metaclass=_Maker):
        pass


class FileModel(_MadeInPython):
    """What is read from a file, see the module.

    Raises:
        FieldError: A field is wrong.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _truth_is_no_number(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        numbers = _number_fields(cls)
        return {name: _marked(value) if name in numbers else value for name, value in given.items()}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with some fields changed. Their values are not checked, as those of a new object are.

        Raises:
            ValueError: A name is no field; pydantic would add it, without effect.
        """
        fields = type(self).model_fields
        for name in update or ():
            if name not in fields:
                raise ValueError(f"{name}: unknown field{did_you_mean(name, fields)}")
        return super().model_copy(update=update, deep=deep)


def in_words(error: ValidationError, model: type[BaseModel]) -> FieldError:
    """The error of an object that was to be made of these fields."""
    found = reasons(error.errors(include_url=False), model)
    return FieldError(describe(error, model), found, model.__name__)


class _TruthValue:
    """A truth value that no validator takes for a number."""

    def __init__(self, value: bool) -> None:
        self._value = value

    def __repr__(self) -> str:
        return str(self._value).lower()


def _marked(value: Any) -> Any:
    """A value with the truth values in it marked."""
    if isinstance(value, list | tuple):
        return [_marked(part) for part in value]
    if isinstance(value, dict):
        return {key: _marked(part) for key, part in value.items()}
    return _TruthValue(value) if isinstance(value, bool) else value


@cache
def _number_fields(model: type[BaseModel]) -> frozenset[str]:
    """The fields for numbers in which no truth value can be meant."""
    kinds = {name: set(_kinds(field.annotation)) for name, field in model.model_fields.items()}
    return frozenset(name for name, own in kinds.items() if own & {int, float} and bool not in own)


def _kinds(annotation: Any) -> list[Any]:
    """The types in a type such as `tuple[float, ...] | None`, itself included."""
    return [annotation, *(kind for part in get_args(annotation) for kind in _kinds(part))]
