"""The page /docs: every operation has a title of its own, and stands in one of the named groups."""

from pathlib import Path

from contactsense.service.api.app import GROUPS, create_app
from contactsense.service.api.settings import Settings


def test_operations_have_titles_and_groups() -> None:
    description = create_app(Settings()).openapi()
    assert [group["name"] for group in description["tags"]] == list(GROUPS)
    operations = [operation for path in description["paths"].values() for operation in path.values()]
    titles = [operation["summary"] for operation in operations]
    assert len(set(titles)) == len(titles) > 15
    for operation in operations:
        (group,) = operation["tags"]
        assert group in GROUPS
        # A title made from the function's name begins the identity of the operation, too.
        assert not operation["operationId"].startswith(operation["summary"].lower().replace(" ", "_") + "_")
    assert {operation["tags"][0] for operation in operations} == set(GROUPS)


def test_every_close_code_is_on_the_page_of_controllers() -> None:
    page = (Path(__file__).parents[3] / "docs" / "controllers.md").read_text(encoding="utf-8")
    described = create_app(Settings()).description
    (row,) = [line for line in described.splitlines() if line.startswith("| `WS /v1/track`")]
    for code in row.rpartition("|")[0].rpartition("|")[2].split(","):
        assert f"- {code.strip()}: " in page


def test_every_field_and_parameter_is_described() -> None:
    description = create_app(Settings()).openapi()
    fields = {
        f"{name}.{field}": value
        for name, model in description["components"]["schemas"].items()
        for field, value in model.get("properties", {}).items()
    }
    parameters = {
        f"{path} {parameter['name']}": parameter
        for path, operations in description["paths"].items()
        for operation in operations.values()
        for parameter in operation.get("parameters", [])
    }
    assert len(fields) > 100
    assert parameters
    told = fields | parameters
    assert [name for name, each in told.items() if not each.get("description") and "$ref" not in each] == []


def test_the_page_asks_for_the_token_where_there_is_one() -> None:
    assert "securitySchemes" not in create_app(Settings()).openapi()["components"]
    description = create_app(Settings(token="0123456789abcdef")).openapi()
    (scheme,) = description["components"]["securitySchemes"].values()
    assert scheme == {"type": "http", "scheme": "bearer"}
    for path, operations in description["paths"].items():
        for operation in operations.values():
            assert bool(operation.get("security")) == (path != "/v1/ready"), path
