"""The interface does as its description says, whatever it is asked (schemathesis), and nothing breaks it."""

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from tests.service.serving import serving

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def place() -> Iterator[str]:
    with serving(create_app(Settings(max_request_rate=1e6))) as found:
        yield found


def test_the_interface_is_as_it_is_described(place: str) -> None:
    # Only this test needs it, and each worker would spend a second to import it.
    import schemathesis
    from schemathesis import checks
    from schemathesis.specs.openapi import checks as openapi_checks

    everything = [
        checks.not_a_server_error,
        openapi_checks.status_code_conformance,
        openapi_checks.content_type_conformance,
        openapi_checks.response_schema_conformance,
        openapi_checks.unsupported_method,
    ]
    url = f"http://{place}"
    schema = schemathesis.openapi.from_url(f"{url}/openapi.json")
    tried = 0
    for found in schema.get_all_operations():
        operation = found.ok()

        @given(case=operation.as_strategy())
        @settings(max_examples=60, suppress_health_check=list(HealthCheck))
        def check(case: schemathesis.Case) -> None:
            response = case.call(base_url=url)
            # No robot: 503 is right, and described.
            case.validate_response(
                response, checks=everything[1:] if response.status_code == 503 else everything
            )

        check()
        tried += 1
    assert tried >= 7
