"""Names that a user may have meant, for messages about unknown ones."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown `name`: the known one that is nearest; empty if none is near."""
    near = get_close_matches(name, list(known), 1)
    return f" (did you mean {near[0]}?)" if near else ""


def fields_at(model: type[BaseModel], place: Iterable[int | str]) -> set[str]:
    """Names of the fields that may stand at a place within data for `model`.

    Args:
        model: The model of the whole data.
        place: Path to the object with the fields, as in Pydantic's errors: fields, keys, indices, and tags of
            unions.
    """
    models = {model}
    for step in place:
        found = set[type[BaseModel]]()
        for candidate in models:
            for name, info in candidate.model_fields.items():
                if step in (name, info.alias):
                    found |= _models_in(info.annotation)
        # Keys, indices and tags lead to the same models as the field before them.
        models = found or models
    return {info.alias or name for candidate in models for name, info in candidate.model_fields.items()}


def _models_in(annotation: Any) -> set[type[BaseModel]]:
    """All models in an annotation, such as those of a union in a tuple."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}
    return {model for part in get_args(annotation) for model in _models_in(part)}
