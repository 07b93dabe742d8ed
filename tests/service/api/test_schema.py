"""The interface does as its description says, whatever it is asked (schemathesis), and nothing breaks it."""

from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from tests.service.serving import serving

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
    unsupported_method,
]


@pytest.fixture(scope="module")
def place() -> Iterator[str]:
    with serving(create_app(Settings(max_request_rate=1e6))) as found:
        yield found


def test_the_interface_is_as_it_is_described(place: str) -> None:
    url = f"http://{place}"
    schema = schemathesis.openapi.from_url(f"{url}/openapi.json")
    tried = 0
    for found in schema.get_all_operations():
        operation = found.ok()

        @given(case=operation.as_strategy())
        @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
        def check(case: schemathesis.Case) -> None:
            response = case.call(base_url=url)
            # No robot: 503 is right, and described.
            checks = [check for check in CHECKS if response.status_code != 503 or check != not_a_server_error]
            case.validate_response(response, checks=checks)

        check()
        tried += 1
    assert tried >= 7
