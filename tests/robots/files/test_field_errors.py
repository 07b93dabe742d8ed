"""Errors of fields in words that name what was expected, what was given, and the field that was meant."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationError

from contactsense.robots.files.field_errors import describe, joined, reasons
from contactsense.robots.files.field_places import find
from contactsense.robots.files.near_names import did_you_mean

Positive = Annotated[float, Field(gt=0.0)]


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Ball(Part):
    kind: Literal["ball"] = "ball"
    radius: PositiveFloat = 1.0


class Slab(Part):
    kind: Literal["slab"] = "slab"
    thickness: float = Field(1.0, le=5.0)


class Whole(Part):
    parts: tuple[Annotated[Ball | Slab, Field(discriminator="kind")], ...] = ()
    named: dict[str, Ball] = {}
    place: tuple[float, float] | None = None
    long: Annotated[tuple[float, ...], Field(min_length=2)] = (0.0, 0.0)
    while_: str = Field("", alias="while")
    share: Positive | tuple[Positive, ...] = 1.0
    six: tuple[float, float, float] = (0.0, 0.0, 0.0)
    on: bool = False
    slab: Slab = Slab()
    boxes: tuple["Box", ...] = ()


class Box(Part):
    lid: Slab | None = None
    floor: Slab = Slab()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"partz": 1}, "partz: unknown field (did you mean parts?), got 1"),
        ({"wile": "x"}, "wile: unknown field (did you mean while?), got 'x'"),
        ({"thickness": 1}, "thickness: unknown field (did you mean slab.thickness?), got 1"),
        (
            {"boxes": [{"thickness": 2}]},
            "boxes[0].thickness: unknown field (did you mean boxes[0].lid.thickness or "
            "boxes[0].floor.thickness?), got 2",
        ),
        (
            {"slab": {"share": 1}},
            "slab.share: unknown field (did you mean share at the outermost level?), got 1",
        ),
        (
            {"colour": 1},
            "colour: unknown field (known: boxes, long, named, on, parts, place, share, six, slab, while), "
            "got 1",
        ),
        ({"slab": {"x": 1}}, "slab.x: unknown field (known: kind, thickness), got 1"),
        ({"parts": [{"kind": "cube"}]}, "parts[0]: expected 'kind' to be one of 'ball', 'slab', got 'cube'"),
        ({"parts": [{}]}, "parts[0]: expected the field 'kind'"),
        (
            {"parts": [{"kind": "slab", "thicknes": 1}]},
            "parts[0].thicknes: unknown field (did you mean thickness?), got 1",
        ),
        (
            {"named": {"a": {"raduis": 1}}},
            "named.a.raduis: unknown field (did you mean radius?), got 1",
        ),
        ({"named": {"a": {"radius": 0}}}, "named.a.radius: expected a number above 0, got 0"),
        (
            {"parts": [{"kind": "slab", "thickness": 6}]},
            "parts[0].thickness: expected a number of at most 5, got 6",
        ),
        ({"long": [1]}, "long: expected a length of at least 2, got 1"),
        ({"place": [1]}, "place: expected 2 values, got 1"),
        ({"place": [1, "x"]}, "place[1]: expected a number, got 'x'"),
        ({"place": 3}, "place: expected a list, got 3"),
        ({"six": [1]}, "six: expected 3 values, got 1"),
        ({"six": [1, 2, 3, 4]}, "six: expected a length of at most 3, got 4"),
        (
            {"parts": [{"kind": "slab", "radius": 1}]},
            "parts[0].radius: unknown field (known: kind, thickness), got 1",
        ),
        ({"share": 0}, "share: expected a number above 0 or a list, got 0"),
        ({"share": [1, 0]}, "share[1]: expected a number above 0, got 0"),
        ({"share": None}, "share: expected a number or a list, got null"),
        ({"on": "x"}, "on: expected true or false, got 'x'"),
        ({"named": 3}, "named: expected an object with fields, got 3"),
        ({"place": [True, {"a": 1}]}, "place[1]: expected a number, got {'a': 1}"),
    ],
)
def test_words(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Whole.model_validate(given)
    assert describe(refused.value, Whole) == words


@pytest.mark.parametrize(("given", "told"), [("none", "'none'"), (False, "false"), (3, "3")])
def test_how_to_write_that_there_is_none_is_told(given: object, told: str) -> None:
    class Cell(BaseModel):
        sensor: Ball | None = None
        arm: Ball

    with pytest.raises(ValidationError) as refused:
        Cell.model_validate({"sensor": given, "arm": given})
    sensor, arm = describe(refused.value, Cell).split("; ")
    assert sensor == f"sensor: expected fields, or null for none, got {told}"
    assert arm == f"arm: expected fields, got {told}"


def test_a_field_as_the_user_writes_it() -> None:
    with pytest.raises(ValidationError) as refused:
        Whole.model_validate({"named": {"a": {"radius": 0}}})
    told = describe(refused.value, Whole, spelled=lambda place: "--" + joined(place[1:]))
    assert told == "--a.radius: expected a number above 0, got 0"


def test_nothing_is_proposed_where_nothing_is_near() -> None:
    assert did_you_mean("rat", ["rate", "every"]) == " (did you mean rate?)"
    assert did_you_mean("x", ["rate", "every"]) == did_you_mean("x", []) == ""
    assert find(Whole, ("parts", 0, "ball")).fields == {"kind", "radius"}


def test_a_field_with_the_name_of_a_branch_keeps_it() -> None:
    """Only what pydantic has inserted is left out of the path."""
    with pytest.raises(ValidationError) as refused:
        Whole.model_validate({"parts": [{"kind": "ball", "ball": 1}], "named": {"ball": {"radius": 0}}})
    assert describe(refused.value, Whole) == (
        "parts[0].ball: unknown field (known: kind, radius), got 1; named.ball.radius: expected a number "
        "above 0, got 0"
    )


def test_no_more_errors_are_put_into_words_than_somebody_reads() -> None:
    issues = [{"type": "float_type", "loc": ("x", i), "msg": "", "input": "a"} for i in range(5000)]
    assert list(reasons(issues, list[float])) == [("x", i) for i in range(100)]


def test_of_a_large_value_no_more_is_shown_than_somebody_reads() -> None:
    """As where one file is taken for another."""
    rules = {f"rule {i}": {f"field {k}": [[k, k, k]] * 8 for k in range(8)} for i in range(8)}
    told = reasons([{"type": "list_type", "loc": ("x",), "msg": "", "input": rules}], list[float])["x",]
    assert told.startswith("expected a list, got {'rule 0': {'field 0': [[0, 0, 0], ")
    assert len(told) < 150
    assert told.endswith("...")
