"""A misspelled parameter, or one that is given twice, is named; it is not ignored."""

from collections.abc import Iterator

import httpx
import pytest
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

from contactsense.service.api.app import create_app
from contactsense.service.api.messages import ErrorOut, FieldError
from contactsense.service.api.settings import Settings
from tests.service import http
from tests.service.serving import serving


@pytest.fixture(scope="module")
def place() -> Iterator[str]:
    with serving(create_app(Settings())) as found:
        yield found


@pytest.mark.parametrize(
    ("path", "name", "reason"),
    [
        (
            "/v1/events?since=1&lmit=3",
            "lmit",
            "unknown parameter (did you mean limit?); known: since, limit, kind",
        ),
        ("/v1/robot?name=ur5e", "name", "unknown parameter; there are none here"),
        ("/v1/health?token=abc", "token", "unknown parameter; there are none here"),
        ("/v1/events?since=1&since=2", "since", "expected one value, got 2"),
    ],
)
def test_over_http(place: str, path: str, name: str, reason: str) -> None:
    answer: httpx.Response = http.get(f"http://{place}{path}")
    assert answer.status_code == 422
    assert ErrorOut.model_validate(answer.json()).errors == [FieldError(field=name, reason=reason)]


def test_a_list_is_given_value_by_value(place: str) -> None:
    assert http.get(f"http://{place}/v1/events?kind=onset&kind=release").status_code == 200


def test_over_a_websocket(place: str) -> None:
    with connect(f"ws://{place}/v1/stream?rat=30&token=none-is-needed") as stream:
        (error,) = ErrorOut.model_validate_json(stream.recv(timeout=60)).errors
        assert error.field == "rat"
        assert error.reason == "unknown parameter (did you mean rate?); known: every, rate"
        with pytest.raises(ConnectionClosedError) as closed:
            stream.recv(timeout=60)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008
