"""All bodies of requests follow one rule: values have the type that the interface states."""

from typing import Any

import pytest
from pydantic import ValidationError

from contactsense.service.api.clips import ClipIn, RecordingIn
from contactsense.service.api.messages import LocateManyIn, LocateOneIn
from contactsense.service.api.request_body import RequestBody
from contactsense.service.api.routes.reactions import AcknowledgeIn, ExpectedIn


@pytest.mark.parametrize(
    ("body", "field", "value"),
    [
        (RecordingIn, "on", "yes"),
        (RecordingIn, "on", 1),
        (ClipIn, "before", "1"),
        (ClipIn, "after", True),
        (ClipIn, "before", float("inf")),
        (ClipIn, "reason", 5),
        (AcknowledgeIn, "rule", 1),
        (ExpectedIn, "open", "no"),
        (LocateOneIn, "external", "false"),
        (LocateManyIn, "external", 0),
    ],
)
def test_a_value_of_another_type_is_refused(body: type[RequestBody], field: str, value: Any) -> None:
    with pytest.raises(ValidationError) as refused:
        body.model_validate({field: value})
    assert (field,) in [error["loc"] for error in refused.value.errors()]


def test_whole_numbers_are_numbers() -> None:
    assert ClipIn.model_validate({"before": 2, "after": 0.5}).before == 2.0
    assert RecordingIn.model_validate({"on": True}).on


@pytest.mark.parametrize("body", [RecordingIn, ClipIn, AcknowledgeIn, ExpectedIn, LocateOneIn, LocateManyIn])
def test_unknown_fields_are_refused(body: type[RequestBody]) -> None:
    with pytest.raises(ValidationError) as refused:
        body.model_validate({"unknown": 1})
    assert ("unknown",) in [error["loc"] for error in refused.value.errors()]
